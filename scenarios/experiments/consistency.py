"""Do the filters know how wrong they are? NEES and NIS of every filter over fifty flights."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import chi2

from estimators import altitude, position
from estimators.eyes import Eyes
from estimators.navigator import Navigator
from estimators.navigators.lei2012 import LeiNavigator
from flightlog.equipment import Equipment
from flightlog.rotations import matrix
from flightlog.signals import Measurement, StateEstimate
from scenarios.experiments.contract import Effort, Figure, Floats, Job, Outcome, Plot, Series
from scenarios.flight import fly
from scenarios.load import load
from scenarios.schema import Scenario
from sim.world import World

NAME = "consistency"
SYSTEM = "all"
TITLE = "Consistency of the filters: NEES and NIS over fifty flights"
ABOUT = (
    "Fifty landings with everything aboard and fifty hovers without a mark, by GPS, barometer and inertial sensors, "
    "each with errors and wind of its own, flown on the pad camera's error model. Normalised estimation error squared "
    "against the truth, five times a second until touchdown, and normalised innovation squared with the prior "
    "covariance of every measurement. A filter that knows how wrong it is has a mean over the flights inside the "
    "chi-square band of fifty draws. Lei's filter runs along as a passenger: it takes GPS and vision for white, which "
    "they are not."
)

FLIGHTS = {"full": 50, "quick": 6}
SETTLED = 3.0  # [s] after the start; from then on it counts
EVERY = 0.2  # [s] errors are taken
TAKE = 0.4  # [s] innovations are taken: well within the filters' memory
RIPE = 0.3  # [s] after which nothing late changes them any more
CHUNK = 5  # flights a job

# what the NEES is taken over, and how many numbers that are
DEGREES = {"altitude": 4, "position": 6, "level": 2, "heading": 1, "Lei 2012, as published": 2}
STATES = {
    "altitude": "height, climb rate, biases of barometer and GPS",
    "position": "east, north, their velocities, GPS bias",
    "level": "tilt error, two axes",
    "heading": "heading",
    "Lei 2012, as published": "height, bias of the barometer",
}
SENSORS = {
    "altitude": ("barometer", "GPS height", "GPS climb", "vision height", "ranger"),
    "position": ("GPS east", "GPS north", "GPS velocity east", "GPS velocity north", "vision, wide", "vision, narrow"),
}
CASES = {
    "everything aboard": ("landing", {}),
    "no mark in sight": ("hover", {"pad": "none", "duration_s": 40.0}),
}
PUBLISHED = "Lei 2012, as published"


@dataclass
class Witness:
    """Looks at the truth and at what the filters say of it, once in a while."""

    nees: dict[str, list[tuple[float, float]]] = field(default_factory=lambda: {name: [] for name in DEGREES})
    nis: dict[str, list[float]] = field(default_factory=dict)
    _next: float = SETTLED
    _take: float = SETTLED + TAKE
    _cycle: Any = None
    _down: bool = False

    def __call__(
        self, world: World, measurements: Sequence[Measurement], navigator: Any, state: StateEstimate
    ) -> None:
        """One step of the loop."""
        self._down |= world.contact.count > 0
        t = world.truth.t
        if self._down or t < SETTLED:
            return
        passenger: LeiNavigator = navigator.passenger
        if passenger.filter.last is not None and passenger.filter.last is not self._cycle:
            self._cycle = last = passenger.filter.last
            share = float(last.residual @ np.linalg.solve(last.spread, last.residual)) / len(last.residual)
            self.nis.setdefault(PUBLISHED, []).append(share)
        if t >= self._next:
            self._next += EVERY
            self._judge(world, navigator)
        if t >= self._take:
            self._take += TAKE
            _, high, side = navigator.filters
            for name, kalman in (("altitude", high.kalman), ("position", side.kalman)):
                found = kalman.innovations()
                ripe = (found.t > t - RIPE - TAKE) & (found.t <= t - RIPE)
                ripe &= found.component < len(SENSORS[name])
                share = found.residual[ripe] ** 2 / found.variance[ripe]
                for component, value in zip(found.component[ripe], share.tolist(), strict=True):
                    self.nis.setdefault(SENSORS[name][component], []).append(value)

    def _judge(self, world: World, navigator: "Accompanied") -> None:
        truth, faults = world.truth, world.sensor_errors()
        attitude, high, side = navigator.filters
        gps, baro = np.array(faults["gps"]), faults["baro"][0] + faults["baro"][1]  # bias and drift

        last, keep = high.kalman.last, [altitude.H, altitude.V, altitude.B_Q, altitude.B_G]
        true = np.array([truth.position[2], truth.velocity[2], baro, gps[2]])
        self._put("altitude", truth.t, last["x"][keep] - true, last["p"][np.ix_(keep, keep)])

        last = side.kalman.last
        keep = [position.E, position.N, position.VE, position.VN, position.G_E, position.G_N]
        true = np.concatenate([truth.position[:2], truth.velocity[:2], gps[:2]])
        self._put("position", truth.t, last["x"][keep] - true, last["p"][np.ix_(keep, keep)])

        a = attitude.memory[0]
        turned = matrix(a["q"]) @ truth.rotation.T
        twist = 0.5 * np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
        self._put("level", truth.t, twist[:2], a["variance_level"] * np.eye(2))
        self._put("heading", truth.t, twist[2:], np.array([[a["variance_heading"]]]))

        lei = navigator.passenger.filter
        keep = [0, lei.bias]
        error = lei.x[keep] - np.array([truth.position[2], baro])
        self._put(PUBLISHED, truth.t, error, lei.p[np.ix_(keep, keep)])

    def _put(self, name: str, t: float, error: Floats, covariance: Floats) -> None:
        self.nees[name].append((t, float(error @ np.linalg.solve(covariance, error))))


class Accompanied(Navigator):
    """Helideck's navigator, with Lei's filter as a passenger that hears the same and is not asked."""

    def __init__(self, equipment: Equipment) -> None:
        super().__init__(equipment, Eyes())
        self.passenger = LeiNavigator(equipment, self)
        self.steer = self.passenger.steer

    def update(self, measurements: Sequence[Measurement]) -> StateEstimate:
        """The state; the passenger hears the measurements."""
        state = super().update(measurements)
        self.passenger.listen(measurements, state)
        return state


def _navigator(equipment: Equipment, scenario: Scenario, sees: bool) -> Accompanied:
    return Accompanied(equipment)


@dataclass(frozen=True, eq=False)
class FlightShares:
    """Of one flight."""

    t: Floats  # (K,) [s]
    nees: dict[str, Floats]  # (K,) by filter
    nis: dict[str, float]  # time average by sensor
    counts: dict[str, int]


def fly_some(case: str, seeds: Sequence[int]) -> list[FlightShares]:
    """The shares of some flights of a case."""
    name, changes = CASES[case]
    found = []
    for seed in seeds:
        witness = Witness()
        fly(load(name, changes), seed=(14, seed), cameras=False, navigator=_navigator, onlooker=witness)
        nees = {name: np.array(rows) for name, rows in witness.nees.items()}
        found.append(
            FlightShares(
                nees["altitude"][:, 0],
                {name: rows[:, 1] for name, rows in nees.items()},
                {name: float(np.mean(values)) for name, values in witness.nis.items()},
                {name: len(values) for name, values in witness.nis.items()},
            )
        )
    return found


def jobs(effort: Effort) -> Sequence[Job]:
    """Some flights a job."""
    seeds = range(FLIGHTS[effort])
    chunks = [tuple(seeds[k : k + CHUNK]) for k in range(0, len(seeds), CHUNK)]
    return [Job(fly_some, (case, part), f"consistency, {case}", 2.0 * len(part)) for case in CASES for part in chunks]


def band(degrees: int, flights: int, share: float) -> tuple[float, float]:
    """Where the mean of chi-square numbers of so many degrees over so many flights lies with a probability `share`."""
    edges = chi2.ppf([0.5 - 0.5 * share, 0.5 + 0.5 * share], degrees * flights) / flights
    return float(edges[0]), float(edges[1])


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """Means over flights beside their bands."""
    number = FLIGHTS[effort]
    chunks = len(answers) // len(CASES)
    figures: list[Figure] = []
    plots: list[Plot] = []
    nees_rows, nis_rows = [], []
    for k, case in enumerate(CASES):
        flights: list[FlightShares] = [one for answer in answers[k * chunks : (k + 1) * chunks] for one in answer]
        length = min(len(one.t) for one in flights)
        t = flights[0].t[:length]
        for name, degrees in DEGREES.items():
            mean = float(np.mean([one.nees[name].mean() for one in flights]))
            course = np.mean([one.nees[name][:length] for one in flights], axis=0)
            inner, outer = band(degrees, number, 0.95), band(degrees, number, 0.999)
            inside = float(np.mean((course > inner[0]) & (course < inner[1])))
            ours = name != PUBLISHED
            nees_rows.append(
                {
                    "case": case, "filter": name, "of": STATES[name], "numbers": degrees, "NEES": round(mean, 2),
                    "95 % band": f"{inner[0]:.2f} .. {inner[1]:.2f}",
                    "99.9 % band": f"{outer[0]:.2f} .. {outer[1]:.2f}", "inside": outer[0] < mean < outer[1],
                    "time inside 95 %": round(inside, 2),
                }
            )  # fmt: skip
            low = outer[0] < mean
            figures.append(
                Figure(
                    f"NEES, {name}, {case}", "1", None, None if ours else mean, mean if ours else None,
                    bar=(outer[1] if low else outer[0]) if ours else None, at_most=low,
                    note=f"{degrees} expected; 99.9 % band {outer[0]:.2f} .. {outer[1]:.2f}",
                )
            )  # fmt: skip
            plots.append(
                Plot(
                    f"NEES of {name}, {case}",
                    f"Mean over {number} flights; it should stay inside the bands around {degrees}.",
                    "time [s]", "NEES [1]", [Series("mean over flights", t, course)],
                    bands=[("99.9 %", *outer), ("95 %", *inner)], log_y=not ours,
                )
            )  # fmt: skip
        edges, wide = band(1, number, 0.95), band(1, number, 0.999)
        groups = {**SENSORS, PUBLISHED: (PUBLISHED,)}
        for name, sensors in groups.items():
            heard = [s for s in sensors if any(s in one.nis for one in flights)]
            total = hits = 0.0
            for sensor in heard:
                values = [one.nis[sensor] for one in flights if sensor in one.nis]
                counts = [one.counts[sensor] for one in flights if sensor in one.nis]
                total += float(np.dot(values, counts))
                hits += sum(counts)
                mean = float(np.mean(values))
                nis_rows.append(
                    {"case": case, "filter": name, "measurement": sensor, "NIS": round(mean, 3), "samples": sum(counts),
                     "95 % band": f"{edges[0]:.2f} .. {edges[1]:.2f}",
                     "99.9 % band": f"{wide[0]:.2f} .. {wide[1]:.2f}", "inside": wide[0] < mean < wide[1]}
                )  # fmt: skip
            mean, ours = total / max(hits, 1.0), name != PUBLISHED
            low = wide[0] < mean
            figures.append(
                Figure(
                    f"NIS, {name}, {case}", "1", None, None if ours else mean, mean if ours else None,
                    bar=(wide[1] if low else wide[0]) if ours else None, at_most=low,
                    note=f"all its measurements, 1 expected; 99.9 % band {wide[0]:.2f} .. {wide[1]:.2f}",
                )
            )  # fmt: skip
    notes = [
        "Bands are those of one chi-square draw a flight: within a flight errors such as biases stay the same, so its "
        "many instants count for little more than one.",
        "The attitude filter is a complementary one: it has no innovations, and its NEES is judged alone.",
        "Lei's filter has a state for the barometer's constant bias; drift, and the errors of GPS and vision, it takes "
        "for white noise of 0.165 and 0.351 m.",
    ]
    return Outcome(figures, plots, notes=notes, tables=[("NEES", nees_rows), ("NIS", nis_rows)])
