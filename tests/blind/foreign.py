"""Effects in other equations than the model's own: terms and faults that stand in no catalogue."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flightlog.constants import GRAVITY
from flightlog.signals import Measurement
from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel
from sim.world import World

PASCALS_A_METRE = 1.225 * GRAVITY
FRAMES = 8  # of the delay line at most


@kernel
def _hayden(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    height = s.height + v.hub[0] * s.up[0] + v.hub[1] * s.up[1] + v.hub[2] * s.up[2]
    ratio = 2.0 * v.rotor_radius / max(height, 0.5 * v.rotor_radius)
    out_of = 0.9926 + 0.0379 * ratio * ratio
    s.ground = 1.0 + p[0] * (min(1.0, 1.0 / out_of) - 1.0)


@kernel
def _exponential(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    height = s.height + v.hub[2] * s.up[2]
    s.ground = (1.0 + p[0] * math.exp(-p[1] * height / v.rotor_radius)) ** -1.5


@kernel
def _step_burn(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    s.mass -= p[0] * p[1] * math.floor(s.time / p[1])


@kernel
def _power_drag(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    speed = math.sqrt(s.velocity[0] ** 2 + s.velocity[1] ** 2 + s.velocity[2] ** 2)
    factor = p[0] * speed ** (p[1] - 1.0) if speed > 1e-6 else 0.0
    for axis in range(3):
        s.force[axis] -= factor * s.velocity[axis]


@kernel
def _two_lags(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    command = (s.collective, s.lateral, s.longitudinal, s.tail)
    share = 1.0 - math.exp(-dt / (0.5 * p[0]))
    for i in range(4):
        if x[8] == 0.0:
            x[i] = command[i]
            x[4 + i] = command[i]
        x[i] += share * (command[i] - x[i])
        x[4 + i] += share * (x[i] - x[4 + i])
    x[8] = 1.0
    s.collective, s.lateral, s.longitudinal, s.tail = x[4], x[5], x[6], x[7]


@kernel
def _frames(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    # x: a line of FRAMES frames of four controls, time since the last frame, begun
    command = (s.collective, s.lateral, s.longitudinal, s.tail)
    if x[33] == 0.0:
        for frame in range(8):
            for i in range(4):
                x[4 * frame + i] = command[i]
        x[33] = 1.0
    x[32] += dt
    if x[32] >= p[0] - 1e-9:
        x[32] = 0.0
        for frame in range(7, 0, -1):
            for i in range(4):
                x[4 * frame + i] = x[4 * (frame - 1) + i]
        for i in range(4):
            x[i] = command[i]
    back = 4 * int(p[1])
    s.collective, s.lateral, s.longitudinal, s.tail = x[back], x[back + 1], x[back + 2], x[back + 3]


@kernel
def _sticky(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    command = (s.collective, s.lateral, s.longitudinal, s.tail)
    for i in range(4):
        if x[4] == 0.0 or abs(command[i] - x[i]) > 0.5 * p[0]:
            x[i] = command[i]
    x[4] = 1.0
    s.collective, s.lateral, s.longitudinal, s.tail = x[0], x[1], x[2], x[3]


@kernel
def _wake_loss(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    disc = math.pi * v.rotor_radius * v.rotor_radius
    sink = -s.velocity[2] / math.sqrt(max(s.thrust, 1e-6) / (2.0 * s.density * disc))
    s.thrust *= 1.0 - p[0] * max(0.0, 1.0 - abs(sink - 1.0) / 0.6)


@kernel
def _low_push(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    s.force[0] += p[0] * math.exp(-s.height / p[1])


@kernel
def _speed_lift(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    speed2 = s.velocity[0] ** 2 + s.velocity[1] ** 2
    s.force[2] += p[0] * speed2


def _number(name: str) -> Parameter:
    return Parameter(name, "1", -1e9, 1e9, name)


def _term(name: str, stage: Stage, function: Any, *numbers: str, states: int = 0) -> Term:
    return Term(name, stage, function, tuple(map(_number, numbers)), tuple(f"x{i}" for i in range(states)))


HAYDEN = _term("foreign_hayden", Stage.INFLOW, _hayden, "gain")  # Hayden 1976, power in ground effect
EXPONENTIAL = _term("foreign_exponential", Stage.INFLOW, _exponential, "size", "decay")
STEP_BURN = _term("foreign_burn", Stage.MASS, _step_burn, "rate", "every")
POWER_DRAG = _term("foreign_drag", Stage.WRENCH, _power_drag, "factor", "power")
TWO_LAGS = _term("foreign_lag", Stage.COMMAND, _two_lags, "tau", states=9)
FRAME_DELAY = _term("foreign_delay", Stage.COMMAND, _frames, "period", "frames", states=34)
STICKY = _term("foreign_stick", Stage.COMMAND, _sticky, "width", states=5)
WAKE_LOSS = _term("foreign_wake", Stage.FLAPPING, _wake_loss, "depth")
LOW_PUSH = _term("foreign_push", Stage.WRENCH, _low_push, "force", "height")  # stands in no catalogue
SPEED_LIFT = _term("foreign_lift", Stage.WRENCH, _speed_lift, "factor")  # stands in no catalogue


def _moved(sample: Any, metres: float) -> Measurement:
    """A barometer's sample that reads so much higher, pressure and altitude alike."""
    moved: Measurement = sample._replace(
        altitude=sample.altitude + metres, pressure=sample.pressure - PASCALS_A_METRE * metres
    )
    return moved


@dataclass
class StairDrift:
    """A drift that goes by steps."""

    topic: str
    columns: tuple[str, ...]  # a barometer's altitude takes its pressure along
    rates: tuple[float, ...]  # [unit/s]
    every: float = 2.0  # [s]

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """The sample with the steps so far."""
        del rng
        since = self.every * math.floor(t / self.every)
        given: Any = sample
        if self.topic == "baro":
            return _moved(given, self.rates[0] * since)
        stepped: Measurement = given._replace(
            **{c: getattr(given, c) + rate * since for c, rate in zip(self.columns, self.rates, strict=True)}
        )
        return stepped


@dataclass
class BellWash:
    """More pressure under the rotor near the ground, falling off as a bell."""

    world: World
    gain: float
    topic: str = "baro"
    scale: float = 0.6  # [m]

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """The sample with the wash's height error."""
        del t, rng
        truth, site = self.world.truth, self.world.site
        free = max(0.0, float(truth.position[2]) - site.skid_height)
        loading = truth.thrust / (math.pi * site.rotor_radius**2)
        return _moved(sample, -self.gain * loading / PASCALS_A_METRE * math.exp(-((free / self.scale) ** 2)))


@dataclass
class SidedPort:
    """A barometer's port that feels air from ahead and behind more than from the sides."""

    world: World
    coefficient: float
    topic: str = "baro"
    ahead: float = 1.1  # times as much as on the mean; from the sides as much less

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """The sample with the dynamic pressure's height error."""
        del t, rng
        truth = self.world.truth
        u, v, _ = truth.rotation.T @ (truth.velocity - truth.wind)
        felt = self.ahead * u**2 + (2.0 - self.ahead) * v**2
        return _moved(sample, -0.5 * self.coefficient * felt / GRAVITY)


@dataclass
class Boxcar:
    """A barometer that gives the mean of its last samples."""

    samples: int
    topic: str = "baro"
    _kept: list[float] = field(default_factory=list)

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """The mean so far."""
        del t, rng
        given: Any = sample
        self._kept = [*self._kept, given.altitude][-self.samples :]
        return _moved(given, sum(self._kept) / len(self._kept) - given.altitude)


@dataclass
class SoftGround:
    """A ranger over grass: the echo comes from below the surface, the more the lower it is."""

    depth: float  # [m]
    topic: str = "sonar"

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """The range with the depth added."""
        del t, rng
        given: Any = sample
        longer: Measurement = given._replace(range=given.range + self.depth * math.exp(-given.range / 0.8))
        return longer


@dataclass
class White:
    """White noise on columns."""

    topic: str
    columns: Sequence[str]
    std: float

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """The sample with noise added."""
        del t
        given: Any = sample
        noise = self.std * rng.standard_normal(len(self.columns))
        noisy: Measurement = given._replace(
            **{c: getattr(given, c) + float(n) for c, n in zip(self.columns, noise, strict=True)}
        )
        return noisy
