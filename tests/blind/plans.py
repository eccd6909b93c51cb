"""Flight plans that excite a helicopter: hover ladder, landing, box, doublets, turn, descents.

A plan is drawn: heights, corners, headings and times differ from seed to seed. `pilot` turns it into what
`scenarios.fly` wants.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flightlog.signals import Controls, StateEstimate
from scenarios.crew import Pilot, make_pilot
from scenarios.schema import Plan, Scenario, Start, WeatherTable
from sim.sensors.contract import Site
from sim.vehicle import Vehicle

HAND_OVER = 2.0  # [s] before which a plan asks for nothing
TURN_RATE = math.radians(40.0)  # [rad/s] of the heading asked for
DOUBLETS = {"collective": 0.012, "lateral": 0.02, "longitudinal": 0.02, "tail": 0.05}  # [rad]


@dataclass(frozen=True)
class Leg:
    """From `at_s` on: where to go, how fast, and where the nose points."""

    at_s: float
    east: float  # [m] from the pad's centre
    north: float
    height: float  # [m] of the body origin
    heading: float = 0.0  # [rad]
    rate: float = 1.0  # [m/s] up or down
    speed: float = 1.5  # [m/s] horizontal


@dataclass(frozen=True)
class Doublet:
    """One way for `half_s`, then the other, on top of what the pilot sends."""

    at_s: float
    control: str
    size: float  # [rad]
    half_s: float

    def at(self, t: float) -> float:
        """Its part of the control [rad] at time t [s]."""
        since = t - self.at_s
        return 0.0 if not 0.0 <= since < 2.0 * self.half_s else self.size if since < self.half_s else -self.size


@dataclass(frozen=True)
class FlightPlan:
    """What one flight does."""

    name: str
    duration_s: float
    start_m: tuple[float, float, float]
    legs: tuple[Leg, ...] = ()  # empty: a landing
    doublets: tuple[Doublet, ...] = ()
    steps_m: tuple[float, ...] = ()  # at which a landing pauses
    tilt: float = 0.12  # [rad] that the pilot may use

    def scenario(self, vehicle: str, weather: WeatherTable | None = None) -> Scenario:
        """The scenario of this plan; fly it with `pilot` of the plan."""
        east, north, height = self.start_m
        plan = (
            Plan(goal="hover", point_m=[east, north, height])
            if self.legs
            else Plan(goal="land", point_m=[0.0, 0.0, height], steps_m=list(self.steps_m), step_s=3.0)
        )
        return Scenario(
            vehicle=vehicle, duration_s=self.duration_s, start=Start(position_m=list(self.start_m)), plan=plan,
            weather=weather or WeatherTable(),
        )  # fmt: skip

    def pilot(self, vehicle: Vehicle, site: Site, scenario: Scenario, heading: float) -> Pilot:
        """A `scenarios.crew.PilotMaker`: the project's pilot, sent along the plan."""
        return _Tester(make_pilot(vehicle, site, scenario, heading), self)


class _Course:
    """The pilot's own hover, its demand moved along the legs."""

    def __init__(self, hover: Any, plan: FlightPlan) -> None:
        self._hover, self._plan = hover, plan

    def __getattr__(self, name: str) -> Any:
        return getattr(self._hover, name)

    def update(self, state: StateEstimate) -> Any:
        demand = self._hover.update(state)
        leg = leg_at(self._plan.legs, state.t)
        return demand._replace(
            east=leg.east, north=leg.north, height=leg.height, rate=leg.rate, speed_limit=leg.speed,
            tilt_limit=self._plan.tilt, ground_effect=leg.height < 2.0,
        )  # fmt: skip


class _Tester:
    """A pilot that follows legs and adds doublets."""

    def __init__(self, pilot: Any, plan: FlightPlan) -> None:
        self._pilot, self._plan = pilot, plan
        self._heading: float | None = None
        if plan.legs:
            pilot.sequence = _Course(pilot.sequence, plan)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._pilot, name)

    def update(self, state: StateEstimate) -> Controls:
        """Controls for the period that begins."""
        if self._plan.legs:
            self._turn(leg_at(self._plan.legs, state.t).heading)
        sent: Controls = self._pilot.update(state)
        if not self._plan.doublets:
            return sent
        added = dict.fromkeys(DOUBLETS, 0.0)
        for doublet in self._plan.doublets:
            added[doublet.control] += doublet.at(state.t)
        return sent._replace(**{name: getattr(sent, name) + size for name, size in added.items()})

    def _turn(self, wanted: float) -> None:
        """The heading that the pilot holds goes to `wanted` no faster than TURN_RATE."""
        step = TURN_RATE / 250.0
        self._heading = wanted if self._heading is None else self._heading + float(
            np.clip(wanted - self._heading, -step, step)
        )
        self._pilot.set_heading(self._heading)


def leg_at(legs: Sequence[Leg], t: float) -> Leg:
    """The leg in force at time t [s]."""
    return [leg for leg in legs if leg.at_s <= t or leg is legs[0]][-1]


def ladder(rng: np.random.Generator, duration_s: float = 60.0) -> FlightPlan:
    """Hovers from high to as low as half a rotor radius of free height, and a climb at the end."""
    heights = np.array([rng.uniform(4, 8), rng.uniform(2.2, 3.2), rng.uniform(1.2, 1.7), rng.uniform(0.75, 1.0),
                        rng.uniform(0.55, 0.7), rng.uniform(2.0, 5.0)])  # fmt: skip
    shares = np.array([0.0, 0.15, 0.3, 0.45, 0.62, 0.85])
    heading = rng.uniform(0.0, 2.0 * math.pi)
    legs = [Leg(float(s) * duration_s, 0.0, 0.0, float(h), heading, 1.0) for s, h in zip(shares, heights, strict=True)]
    doublets = _every(rng, 0.08 * duration_s, 0.13 * duration_s, duration_s, 0.5, after=0.9)
    return FlightPlan("ladder", duration_s, (0.0, 0.0, float(heights[0])), tuple(legs), doublets)


def box(rng: np.random.Generator, duration_s: float = 60.0) -> FlightPlan:
    """A square flown at a few metres a second, the nose now ahead and now where it was."""
    side, height, speed = rng.uniform(7.0, 10.0), rng.uniform(4.0, 7.0), rng.uniform(3.0, 4.5)
    first, sense = rng.uniform(0.0, 2.0 * math.pi), float(rng.choice([-1.0, 1.0]))
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0), (-0.7, 0.4), (0.0, 0.0)]
    follows = rng.random() < 0.5
    legs = []
    for i, (x, y) in enumerate(corners):
        heading = first + (sense * 0.5 * math.pi * i if follows else 0.0)
        east, north = (
            side * (x * math.cos(first) + sense * y * math.sin(first)),
            side * (-x * math.sin(first) + sense * y * math.cos(first)),
        )
        legs.append(Leg(duration_s * i / len(corners), east, north, height, heading, 1.0, speed))
    return FlightPlan("box", duration_s, (0.0, 0.0, height), tuple(legs), tilt=0.2)


def doublets(rng: np.random.Generator, duration_s: float = 60.0) -> FlightPlan:
    """Doublets on every control in a hover over the mark."""
    height, heading = rng.uniform(3.5, 6.0), rng.uniform(0.0, 2.0 * math.pi)
    legs = (Leg(0.0, 0.0, 0.0, height, heading),)
    train = _every(rng, 3.0, 2.2, duration_s, 1.0)
    return FlightPlan("doublets", duration_s, (0.0, 0.0, height), legs, train)


def turn(rng: np.random.Generator, duration_s: float = 60.0) -> FlightPlan:
    """Full turns in hover, with some doublets of the collective, and a climb."""
    height, first = rng.uniform(3.0, 5.0), rng.uniform(0.0, 2.0 * math.pi)
    sense = float(rng.choice([-1.0, 1.0]))
    legs = [
        Leg(0.1 * duration_s * i, 0.0, 0.0, height + (2.0 if i >= 7 else 0.0), first + sense * 0.4 * math.pi * i)
        for i in range(10)
    ]
    train = _every(rng, 5.0, 4.0, duration_s, 0.6)
    return FlightPlan("turn", duration_s, (0.0, 0.0, height), tuple(legs), train)


def descents(rng: np.random.Generator, duration_s: float = 60.0) -> FlightPlan:
    """Up slowly, down fast: into the rotor's own wake, and back to the ground's cushion."""
    top, heading = rng.uniform(12.0, 16.0), rng.uniform(0.0, 2.0 * math.pi)
    low, fast = rng.uniform(1.2, 2.0), rng.uniform(2.0, 3.2)
    legs = (
        Leg(0.0, 0.0, 0.0, top, heading), Leg(0.08 * duration_s, 0.0, 0.0, low + 2.0, heading, fast),
        Leg(0.28 * duration_s, 0.0, 0.0, top - 3.0, heading, 2.5), Leg(0.5 * duration_s, 0.0, 0.0, low, heading, fast),
        Leg(0.8 * duration_s, 0.0, 0.0, low + 3.0, heading, 1.5),
    )  # fmt: skip
    return FlightPlan("descents", duration_s, (0.0, 0.0, top), legs)


def landing(rng: np.random.Generator, duration_s: float = 60.0) -> FlightPlan:
    """From aside and above onto the mark, with one pause near the ground."""
    angle, far = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.5, 2.0)
    height = float(np.clip(duration_s / 6.0, 3.0, 10.0)) * rng.uniform(0.8, 1.0)
    start = (far * math.cos(angle), far * math.sin(angle), height + rng.uniform(0.0, 0.8))
    return FlightPlan("landing", duration_s, start, steps_m=(float(rng.uniform(0.8, 1.5)),))


PLANS: Mapping[str, Callable[..., FlightPlan]] = {
    plan.__name__: plan for plan in (ladder, landing, box, doublets, turn, descents)
}


def weather(rng: np.random.Generator, wind_std: float) -> WeatherTable:
    """Wind of `wind_std` [m/s] either way, drawn within what the pilot can hold; a day's temperature and pressure."""
    east, north = wind_std * rng.standard_normal(2)
    speed = min(math.hypot(east, north), 2.2 * wind_std, 6.5)
    return WeatherTable(
        wind_m_s=float(speed), wind_from_deg=math.degrees(math.atan2(-east, -north)),
        temperature_degC=float(rng.uniform(5.0, 28.0)), pressure_hPa=float(rng.uniform(990.0, 1030.0)),
    )  # fmt: skip


def _every(
    rng: np.random.Generator, first: float, apart: float, duration_s: float, share: float, after: float = 1.0
) -> tuple[Doublet, ...]:
    """A train of doublets of drawn controls, sizes and lengths; until `after` of the flight."""
    times = np.arange(max(first, HAND_OVER), after * duration_s - 1.5, apart)
    controls = [name for _ in range(len(times) // 4 + 1) for name in rng.permutation(list(DOUBLETS))]
    return tuple(
        Doublet(
            float(t), str(name), float(rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 1.0) * share * DOUBLETS[str(name)]),
            float(rng.uniform(0.25, 0.6)),
        )
        for t, name in zip(times, controls, strict=False)
    )  # fmt: skip
