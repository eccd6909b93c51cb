"""Wu 2019: the stepwise descent to the ring and T landmark on a deck that lies still."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators import navigators
from estimators.eyes import Eyes, FrontEnd
from estimators.navigators import Navigator, Variant
from estimators.vision.ring_mark import RingFrontEnd
from estimators.vision.wu_mark import WuFrontEnd
from estimators.wu_navigator import WuNavigator
from flightlog.equipment import Equipment
from flightlog.marks import RingMark
from flightlog.rotations import angles, multiply, wrap
from flightlog.signals import Frame, Measurement, StateEstimate
from scenarios.cameras import imaging
from scenarios.experiments.contract import Effort, Figure, Floats, Job, Outcome, Picture, Plot, Series
from scenarios.experiments.still_camera import CAMERA, MOUNT, stand, still_camera
from scenarios.flight import fly
from scenarios.load import load
from scenarios.schema import Scenario
from sim import vehicle as vehicles
from sim.world import World

NAME = "deck"
SYSTEM = "wu2019"
TITLE = "Stepwise descent to the ring landmark on a deck"
ABOUT = (
    "The paper flies an unmanned helicopter down to its landmark on a ground-based deck, in large steps, and gives the "
    "dynamic error of X and Y (within 0.1 m), the fluctuation of Z at the steps (about 0.1 m) and the heading's error "
    "(within 1 deg). Here the helicopter comes down in steps to that landmark on the deck of a ship that lies still, "
    "the loop closed on rendered pictures; the published front end and filter run beside ours on the same pictures and "
    "inertial samples, and once fly themselves. The error is that of the estimated position and heading against truth."
)

LOW = 5.0  # [m] below which ours is held to its bars
EVERY = 5  # steps: 50 Hz
SETTLED = 3.0  # [s] for alignment and the first pictures; from then on it counts
SHOWN = (7.0, 3.0, 1.0, 0.4)  # [m] heights of the pictures shown
HEIGHTS = (15.0, 10.0, 5.0, 3.0, 2.0, 1.0, 0.5, 0.25)  # [m] of the stills
TILT, TURN = math.radians(5.0), math.pi  # of the stills
ATTITUDE_STD = math.radians(0.2)  # by which the attitude told with a still is wrong
STILLS = {"full": 24, "quick": 4}
QUICK: Mapping[str, Any] = {
    "start.position_m": [0.2, -0.2, 4.0], "plan.point_m": [0.0, 0.0, 4.0], "plan.steps_m": [2.0, 1.0],
    "plan.step_s": 1.0,
}  # fmt: skip
SEEDS = (1, 2)
WAYS = {"helideck": "ours", "published": "published", "level": "published, level"}


@dataclass(frozen=True, eq=False)
class Descent:
    """What one estimator said during one descent."""

    t: Floats  # (N,) [s]
    height: Floats  # (N,) [m] true
    error: Floats  # (N, 3) [m] estimated less true, east, north, up
    heading: Floats  # (N,) [rad] the same of the heading
    std: Floats  # (N, 3) [m] what the estimator says of its error

    def low(self) -> NDArray[np.bool_]:
        """Which rows (N,) are below LOW."""
        return self.height < LOW


@dataclass(eq=False)
class Witness:
    """Flies one navigator, lets others see what it sees, and compares all of them with the truth until contact."""

    aboard: str  # which of WAYS flies
    beside: Sequence[str]  # which of them watch
    rows: dict[str, list[list[float]]] = field(default_factory=dict)
    pictures: dict[float, NDArray[np.uint8]] = field(default_factory=dict)
    _others: dict[str, Navigator] = field(default_factory=dict)
    _steps: int = 0
    _down: bool = False

    def make(self, equipment: Equipment, scenario: Scenario, sees: bool) -> Navigator:
        """The navigator that flies."""
        self._others = {way: _navigator(way, equipment) for way in self.beside}
        return _navigator(self.aboard, equipment)

    def __call__(
        self, world: World, measurements: Sequence[Measurement], navigator: Any, state: StateEstimate
    ) -> None:
        """One step of the loop."""
        truth = world.truth
        height = float(truth.position[2])
        self._down |= height < world.site.skid_height + 0.01
        said = {self.aboard: state, **{way: other.update(measurements) for way, other in self._others.items()}}
        for item in measurements:
            if isinstance(item, Frame) and item.camera == "down" and not self._down:
                self._show(item.image, navigator.overlays.get("down", ()), height)
        if self._steps % EVERY == 0 and truth.t >= SETTLED and not self._down:
            _, _, heading = angles(truth.quaternion)
            for way, estimate in said.items():
                error = estimate.position - truth.position
                turned = wrap(estimate.heading - heading)
                self.rows.setdefault(way, []).append([truth.t, height, *error, turned, *estimate.std_position])
        self._steps += 1

    def _show(self, image: NDArray[np.uint8], lines: Sequence[Floats], height: float) -> None:
        due = [at for at in SHOWN if at not in self.pictures and height < at]
        if not due or not lines:
            return
        picture = np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2RGB), np.uint8)
        for line in lines:
            if np.all(np.isfinite(line)):
                cv2.polylines(picture, [np.rint(line).astype(np.int32)], False, (90, 255, 140), 2, cv2.LINE_AA)
        self.pictures[due[0]] = picture
        for at in due[1:]:  # begun below them
            self.pictures[at] = picture

    def descents(self) -> dict[str, Descent]:
        """By way."""
        found = {}
        for way, rows in self.rows.items():
            table = np.array(rows)
            found[way] = Descent(table[:, 0], table[:, 1], table[:, 2:5], table[:, 5], table[:, 6:9])
        return found


def _navigator(way: str, equipment: Equipment) -> Navigator:
    down, mark = equipment.cameras["down"], equipment.mark
    if way == "level" and isinstance(mark, RingMark):
        return WuNavigator(equipment, Eyes(pad=WuFrontEnd(down.model, down.mount, mark)))
    variant: Variant = "helideck" if way == "helideck" else "published"
    return navigators.make("wu2019", equipment, variant=variant, sees=True)


@dataclass(frozen=True, eq=False)
class Flown:
    """One flight."""

    descents: dict[str, Descent]
    pictures: list[NDArray[np.uint8]]  # the highest first
    landed: bool
    offset: float | None  # [m] of the touchdown


def descend(aboard: str, beside: Sequence[str], seed: int, effort: Effort) -> Flown:
    """Fly once, rendered."""
    settings: dict[str, Any] = {"cameras.forward_a.rate_hz": 1.0, "cameras.forward_b.rate_hz": 1.0}  # nobody looks
    scenario = load("ring_landing", settings | (dict(QUICK) if effort == "quick" else {}))
    witness = Witness(aboard, beside)
    flight = fly(scenario, seed=seed, navigator=witness.make, onlooker=witness, name="ring_landing")
    pictures = list({id(witness.pictures[at]): witness.pictures[at] for at in SHOWN if at in witness.pictures}.values())
    return Flown(witness.descents(), pictures, flight.summary.landed, flight.summary.touchdown_offset_m)


def stills(number: int, seed: int) -> list[dict[str, Any]]:
    """Both front ends on single pictures, with nothing known beforehand: errors in camera axes, a row a height."""
    mark, rng = RingMark(), np.random.default_rng(seed)
    down = imaging(vehicles.load("raptor90").cameras, load("ring_landing").cameras)["down"]
    eyes: dict[str, FrontEnd] = {
        "ours": RingFrontEnd(CAMERA, MOUNT, mark),
        "published": WuFrontEnd(CAMERA, MOUNT, mark, exact=True),
    }
    rows = []
    with still_camera(mark, "deck", down, seed) as camera:
        for height in HEIGHTS:
            errors: dict[str, list[Floats]] = {name: [] for name in eyes}
            for index in range(number):
                where = stand(rng, height, tilt=TILT, stray=0.06, turn=TURN)
                slip = np.concatenate([[1.0], 0.5 * rng.normal(0.0, ATTITUDE_STD, 2), [0.0]])
                told = multiply(where.attitude, slip / np.linalg.norm(slip))
                picture = camera.picture(where, index)
                for name, eye in eyes.items():
                    seen = eye.see(picture, told, None)
                    if seen is not None:
                        angle = wrap(seen.angle - where.angle) if seen.std_angle < 0.2 else math.nan
                        errors[name].append(np.append(seen.position - where.to_mark, angle))
            row: dict[str, Any] = {"height [m]": height}
            for name, found in errors.items():
                table = np.array(found).reshape(-1, 4)
                turned = table[np.isfinite(table[:, 3]), 3]
                row |= {
                    f"{name}: found": f"{len(table)}/{number}",
                    f"{name}: x, y RMS [mm]": _rms(table[:, :2], 1e3),
                    f"{name}: z RMS [mm]": _rms(table[:, 2], 1e3),
                    f"{name}: angle RMS [deg]": _rms(turned, 180.0 / math.pi),
                }
            rows.append(row)
    return rows


def _rms(values: Floats, unit: float) -> float | None:
    return round(float(np.sqrt(np.mean(values**2))) * unit, 4) if values.size else None


def jobs(effort: Effort) -> Sequence[Job]:
    """Flights on rendered pictures, and stills."""
    number = STILLS[effort]
    wanted = [Job(stills, (number, 5), "ring stills", cost=0.08 * number * len(HEIGHTS))]
    if effort == "quick":
        return [Job(descend, ("helideck", ("published",), SEEDS[0], effort), "ring descent", cost=25.0), *wanted]
    return [
        Job(descend, ("helideck", ("published", "level"), SEEDS[0], effort), "ring descent", cost=120.0),
        Job(descend, ("helideck", ("published",), SEEDS[1], effort), "ring descent", cost=100.0),
        Job(descend, ("published", (), SEEDS[0], effort), "ring descent, published", cost=90.0),
        *wanted,
    ]


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """Figures, curves, pictures of what was seen, tables by height."""
    *flights, table = answers
    flown: list[Flown] = flights
    ours = [flight.descents["helideck"] for flight in flown if "helideck" in flight.descents]
    theirs = [flight.descents["published"] for flight in flown if "published" in flight.descents]
    top = 4.0 if effort == "quick" else 10.0

    def worst(courses: Sequence[Descent], axis: int, low: bool) -> float:
        return max(float(np.abs(c.error[c.low() if low else slice(None), axis]).max()) for c in courses)

    def rms(courses: Sequence[Descent]) -> float:
        return max(float(np.sqrt(np.mean(c.error[c.low()] ** 2, axis=0)).max()) for c in courses)

    def turned(courses: Sequence[Descent], low: bool) -> float:
        return max(math.degrees(float(np.abs(c.heading[c.low() if low else slice(None)]).max())) for c in courses)

    figures = [
        Figure(f"{axis} error, largest from {top:g} m to the deck", "m", 0.1, worst(theirs, k, False),
               worst(ours, k, False), expected=(0.05, 0.15), note=note)
        for k, (axis, note) in enumerate(
            [("X", "east"), ("Y", "north"), ("Z", "the paper: fluctuation at large steps, from heights not given")]
        )
    ]  # fmt: skip
    figures.append(
        Figure(f"heading error, largest from {top:g} m to the deck", "deg", 1.0, turned(theirs, False),
               turned(ours, False), expected=(0.1, 1.0))
    )  # fmt: skip
    figures += [
        Figure(f"{axis} error, largest below {LOW:g} m", "m", None, worst(theirs, k, True), worst(ours, k, True), 0.02)
        for k, axis in enumerate("XYZ")
    ]
    figures += [
        Figure(f"RMS error below {LOW:g} m, worst axis", "m", None, rms(theirs), rms(ours), 0.005),
        Figure(f"heading error, largest below {LOW:g} m", "deg", None, turned(theirs, True), turned(ours, True), 0.1),
    ]
    level = [flight.descents["level"] for flight in flown if "level" in flight.descents]
    if level:
        figures.append(
            Figure("X, Y error with roll and pitch taken for zero, largest", "m", 0.1,
                   max(worst(level, 0, False), worst(level, 1, False)), None, expected=(0.0, math.inf),
                   note="section 3.1 as it stands: wrong by h tan(tilt); the paper's figure is out of its reach")
        )  # fmt: skip
    offsets = {way: [f.offset for f in flown if way == next(iter(f.descents)) and f.offset is not None]
               for way in ("published", "helideck")}  # fmt: skip
    if all(offsets.values()):
        figures.append(
            Figure("touchdown off the mark's centre", "m", None, max(offsets["published"]), max(offsets["helideck"]),
                   0.10, note="each flown by its own estimator")
        )  # fmt: skip
    first = flown[0].descents
    plots = [
        Plot(
            f"Error of {axis} during the descent",
            f"Estimated less true {direction}; steps at 7, 5, 3, 2 and 1 m." if effort == "full" else
            f"Estimated less true {direction}.",
            "time [s]", "error [m]",
            [Series(WAYS[way], course.t, course.error[:, k]) for way, course in first.items() if way != "level"],
            bands=[("ours below 5 m", -0.02, 0.02)],
        )
        for k, (axis, direction) in enumerate([("X", "east"), ("Y", "north"), ("Z", "height")])
    ]  # fmt: skip
    plots += [
        Plot("Height", "True height of the body origin over the deck.", "time [s]", "height [m]",
             [Series("true", first["helideck"].t, first["helideck"].height)]),
        Plot("Error of the heading", "Below 2.5 m the Ts leave the picture, and the published heading coasts.",
             "time [s]", "error [deg]",
             [Series(WAYS[way], c.t, np.degrees(c.heading)) for way, c in first.items() if way != "level"]),
    ]  # fmt: skip
    shown = flown[0].pictures
    pictures = []
    if shown:
        half = [cv2.resize(p, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for p in shown[:4]]
        joined = np.asarray(np.hstack(half), np.uint8)
        pictures.append(Picture("What the down camera sees", "The rings and the axis as fitted.", joined))
    notes = [
        "Pictures 768 x 494 at 25 Hz, 60 ms late, read noise 1.2 and shot noise 2.2 grey levels, 2 ms exposure, 0.4 px "
        "of defocus; inertial unit, magnetometer and GPS as in the vehicle file; 3 m/s of wind with Dryden turbulence.",
        "The landmark's size, the focal length and the mount are as the front ends are told: what a tape measure and a "
        "calibration leave (0.05 % of each is 2.5 mm of height at 5 m) comes on top.",
        "Ours turns the attitude by the tilt that the landmark's own perspective shows and by its axis; the published "
        "filter has Helideck's attitude, without which it would be off by h tan(tilt).",
    ]
    tables = [("Front ends on single pictures, nothing known beforehand, attitude wrong by 0.2 deg", table)]
    tables.append(("Ours by height, all descents", _by_height(ours)))
    return Outcome(figures, plots, pictures, notes, tables)


def _by_height(courses: Sequence[Descent]) -> list[dict[str, Any]]:
    """RMS and largest errors in bands of height, with what the filter said."""
    rows = []
    edges = (10.5, 7.5, 5.0, 3.0, 2.0, 1.0, 0.0)
    height, error, std, heading = (
        np.concatenate([getattr(course, name) for course in courses]) for name in ("height", "error", "std", "heading")
    )
    for high, low in pairwise(edges):
        within = (height < high) & (height >= low)
        if not within.any():
            continue
        row: dict[str, Any] = {"height [m]": f"{low:g} to {high:g}"}
        for k, axis in enumerate("XYZ"):
            row[f"{axis} RMS [mm]"] = _rms(error[within, k], 1e3)
            row[f"{axis} largest [mm]"] = round(float(np.abs(error[within, k]).max()) * 1e3, 2)
            row[f"{axis} stated [mm]"] = round(float(np.mean(std[within, k])) * 1e3, 2)
        row["heading RMS [deg]"] = _rms(heading[within], 180.0 / math.pi)
        rows.append(row)
    return rows
