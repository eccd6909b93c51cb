"""Synthetic flights with known truth in closed form, and sensors with seeded errors: no simulator in it."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from flightlog.camera import CameraModel, CameraMount
from flightlog.constants import GRAVITY
from flightlog.equipment import CameraSpec, Equipment, SensorSpec
from flightlog.marks import HMark
from flightlog.rotations import from_angles, quaternion
from flightlog.signals import (
    BaroSample,
    GpsSample,
    ImuSample,
    MagSample,
    Measurement,
    PadSample,
    RotorSample,
    SonarSample,
)

Floats = NDArray[np.float64]
FIELD = np.array([1.0, 21.0, -43.0])  # [uT] ENU
ROTOR = 157.08  # [rad/s]
TICK = 0.004  # [s]

NUMBERS = {
    "imu": {
        "accel_noise": 0.0039, "gyro_noise": 8.7e-5, "accel_bias_std": 0.03, "gyro_bias_std": math.radians(0.05),
        "accel_drift_std": 0.005, "accel_drift_tau": 300.0,
        "gyro_drift_std": math.radians(0.008), "accel_scale_std": 0.002,
        "misalignment_std": 0.0,
    },
    "mag": {"noise": 0.3, "bias_std": 0.25, "drift_std": 0.1, "misalignment_std": 0.005},
    "baro": {"noise": 0.1, "bias_std": 0.5, "drift_std": 0.35, "drift_tau": 60.0, "lag": 0.1},
    "gps": {
        "bias_std": 0.5, "bias_std_up": 0.5, "wander_std": 0.25, "wander_std_up": 0.25, "wander_tau": 60.0,
        "noise": 0.02, "noise_up": 0.04, "velocity_noise": 0.05, "hdop": 1.0,
    },
    "sonar": {
        "noise_share": 0.001, "resolution": 0.003, "scale_std": 0.003, "greatest_range": 3.05,
        "beam_half_angle": math.radians(10.0),
    },
    "rotor": {},
}  # fmt: skip
RATES = {"imu": 250.0, "mag": 50.0, "baro": 50.0, "gps": 5.0, "sonar": 20.0, "rotor": 50.0}
MOUNTS = {
    "imu": (0.05, 0.0, -0.03), "mag": (-0.45, 0.0, 0.05), "baro": (0.08, 0.0, -0.02), "gps": (-0.6, 0.0, 0.08),
    "sonar": (0.08, 0.0, -0.03), "rotor": (0.0, 0.0, 0.05),
}  # fmt: skip
LATENCY = {"gps": 0.18}


def make_equipment() -> Equipment:
    camera = CameraSpec(25.0, 0.06, CameraModel.centred(768, 494, 952.4, 816.3), CameraMount.downward([0.0, 0.0, -0.1]))
    return Equipment(
        sensors={
            topic: SensorSpec(RATES[topic], LATENCY.get(topic, 0.0), np.array(MOUNTS[topic]), numbers)
            for topic, numbers in NUMBERS.items()
        },
        cameras={"down": camera},
        mark=HMark(),
        skid_height=0.23,
        nominal_rotor_speed=ROTOR,
        surface_pressure=101_325.0,
        surface_temperature=288.15,
        magnetic_field=FIELD,
    )


def blend(t: Floats, begin: float, end: float) -> tuple[Floats, Floats, Floats]:
    """From 0 to 1 between two times, fifth order: value and two derivatives, no jump in any."""
    span = end - begin
    s = np.clip((np.asarray(t, float) - begin) / span, 0, 1)
    return (
        s**3 * (10 - 15 * s + 6 * s**2),
        30 * s**2 * (1 - s) ** 2 / span,
        60 * s * (1 - s) * (1 - 2 * s) / span**2,
    )


@dataclass(frozen=True, eq=False)
class Waves:
    """A sum of sinusoids that swells from rest in the first seconds: value and derivatives in closed form."""

    amplitude: Floats  # (K,)
    omega: Floats  # (K,) [rad/s]
    phase: Floats  # (K,)

    @classmethod
    def draw(cls, rng: np.random.Generator, amplitude: float, periods: tuple[float, float] = (4.0, 20.0)) -> "Waves":
        omega = 2 * np.pi / rng.uniform(*periods, 4)
        return cls(amplitude * rng.standard_normal(4) / 2 * (omega.min() / omega), omega, rng.uniform(0, 2 * np.pi, 4))

    def __call__(self, t: Floats, order: int = 0) -> Floats:
        angle = np.multiply.outer(np.asarray(t, float), self.omega) + self.phase
        wave = [np.sin(angle + k * np.pi / 2) @ (self.amplitude * self.omega**k) for k in range(order + 1)]
        swell = blend(t, 0.2, 4.0)
        return sum(math.comb(order, k) * swell[order - k] * wave[k] for k in range(order + 1))


@dataclass(frozen=True, eq=False)
class Descent:
    """From `high` to `low` between two times, with a fifth-order blend: no jump in acceleration."""

    high: float
    low: float
    begin: float
    end: float

    def __call__(self, t: Floats, order: int = 0) -> Floats:
        course = blend(t, self.begin, self.end)[order]
        return (self.high if order == 0 else 0.0) + (self.low - self.high) * course


@dataclass(frozen=True, eq=False)
class Motion:
    """Where the body is at any time."""

    east: Waves
    north: Waves
    up: Callable[..., Floats]
    bob: Waves
    roll: Waves
    pitch: Waves
    turn: Waves
    heading: float

    def position(self, t: Floats, order: int = 0) -> Floats:
        """(N, 3) [m], or a derivative of it."""
        return np.stack([self.east(t, order), self.north(t, order), self.up(t, order) + self.bob(t, order)], axis=-1)

    def angles(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Tilted as the acceleration wants it, about a trim of 3 deg to the right, and some of its own."""
        ae, an, _ = np.moveaxis(self.position(t, 2), -1, 0)
        heading = self.heading + self.turn(t)
        forward = ae * np.sin(heading) + an * np.cos(heading)
        right = ae * np.cos(heading) - an * np.sin(heading)
        roll = math.radians(3.0) + right / GRAVITY + self.roll(t)
        return roll, -forward / GRAVITY + self.pitch(t), heading

    def rotation(self, t: Floats):
        return from_angles(*self.angles(t))

    def rates(self, t: Floats) -> Floats:
        """(N, 3) [rad/s] body axes."""
        d = 1e-4
        return (self.rotation(t - d).inv() * self.rotation(t + d)).as_rotvec() / (2 * d)

    def force(self, t: Floats, mount: Floats) -> Floats:
        """(N, 3) [m/s^2] specific force at a mount, body axes."""
        w, d = self.rates(t), 1e-3
        alpha = (self.rates(t + d) - self.rates(t - d)) / (2 * d)
        at_origin = self.rotation(t).inv().apply(self.position(t, 2) + [0, 0, GRAVITY])
        return at_origin + np.cross(alpha, mount) + np.cross(w, np.cross(w, mount))


@dataclass(frozen=True, eq=False)
class Flight:
    """Measurements in order of arrival, and the truth at every tick."""

    motion: Motion
    t: Floats  # (N,)
    updates: list[list[Measurement]]  # N lists: what arrived until t

    def drop(self, kind: type, begin: float = 0.0, end: float = math.inf) -> "Flight":
        """Without the samples of one kind in a span of time."""
        return self.change(kind, lambda s: None if begin <= s.t < end else s)

    def change(self, kind: type, change: Callable[..., Measurement | None]) -> "Flight":
        """With each sample of a kind replaced."""
        updates = []
        for update in self.updates:
            changed = (change(s) if type(s) is kind else s for s in update)
            updates.append([s for s in changed if s is not None])
        return replace(self, updates=updates)


@dataclass(frozen=True)
class Recipe:
    """What flies, and how bad the sensors are; a scale of 0 makes them perfect."""

    duration: float = 30.0
    height: float = 10.0
    descend: tuple[float, float] | None = None  # from `height` to the ground between these times
    sway: float = 0.6  # [m]
    errors: float = 1.0
    vibration: float = 1.0
    pad_below: float = 0.5  # [m] the mark is lost
    baro_downwash: float = 1.5  # [m] at touchdown
    false_echoes: float = 0.05
    latency: dict[str, float] = field(default_factory=lambda: {"gps": 0.18, "pad": 0.06})


def wander(rng: np.random.Generator, n: int, dt: float, std: float, tau: float) -> Floats:
    decay = math.exp(-dt / tau)
    x = np.empty(n)
    x[0] = std * rng.standard_normal()
    for i, z in enumerate(rng.standard_normal(n - 1) * std * math.sqrt(1 - decay**2), 1):
        x[i] = decay * x[i - 1] + z
    return x


def fly(seed: int, recipe: Recipe = Recipe()) -> Flight:
    rng = np.random.default_rng(seed)
    low, span = (0.23, recipe.descend) if recipe.descend else (recipe.height, (0.0, 1.0))
    up = Descent(recipe.height, low, *span)
    calm = Waves(np.zeros(1), np.ones(1), np.zeros(1))
    motion = Motion(
        east=Waves.draw(rng, recipe.sway), north=Waves.draw(rng, recipe.sway), up=up,
        bob=calm if recipe.descend else Waves.draw(rng, 0.3 * recipe.sway),
        roll=Waves.draw(rng, 0.01), pitch=Waves.draw(rng, 0.01), turn=Waves.draw(rng, 0.1),
        heading=rng.uniform(0, 2 * np.pi),
    )  # fmt: skip
    ticks = np.arange(round(recipe.duration / TICK)) * TICK
    k = recipe.errors
    queue: list[tuple[float, int, Measurement]] = []

    def put(samples: Iterable[Measurement], arrival: Floats) -> None:
        first = len(queue)
        queue.extend((a, first + i, s) for i, (a, s) in enumerate(zip(arrival.tolist(), samples, strict=True)))

    put(_imu(motion, ticks, k, recipe.vibration, rng), ticks)
    put(_mag(motion, ticks[::5], k, rng), ticks[::5])
    put(_baro(motion, ticks[::5], k, recipe, rng), ticks[::5])
    put((RotorSample(t, ROTOR) for t in ticks[::5].tolist()), ticks[::5])
    slow = ticks[::50]
    put(_gps(motion, slow, k, recipe, rng), slow + recipe.latency["gps"])
    # 20 Hz is no whole number of ticks
    sonar = np.arange(0.0, recipe.duration, 0.05)
    put(_sonar(motion, sonar, k, recipe, rng), sonar)
    pictures = ticks[::10]
    pads = [s for s in _pad(motion, pictures, k, recipe, rng) if s is not None]
    put(pads, np.array([s.t_arrival for s in pads]))
    queue.sort(key=lambda entry: entry[:2])
    updates: list[list[Measurement]] = [[] for _ in ticks]
    for arrival, _, sample in queue:
        if (i := math.ceil(arrival / TICK - 1e-6)) < len(ticks):
            updates[i].append(sample)
    return Flight(motion, ticks, updates)


def _imu(motion: Motion, t: Floats, k: float, vibration: float, rng: np.random.Generator) -> Iterator[ImuSample]:
    n = NUMBERS["imu"]
    f = motion.force(t - TICK / 2, np.array(MOUNTS["imu"])) + k * n["accel_bias_std"] * rng.standard_normal(3)
    w = motion.rates(t) + k * n["gyro_bias_std"] * rng.standard_normal(3)
    f += k * n["accel_noise"] * math.sqrt(125) * rng.standard_normal(f.shape)
    w += k * n["gyro_noise"] * math.sqrt(125) * rng.standard_normal(w.shape)
    turn = ROTOR * t[:, None] + rng.uniform(0, 2 * np.pi, 3)
    f += vibration * (1.5 * np.sin(turn) + 1.5 * np.sin(2 * turn + 1.0) + 0.3 * np.sin(4.6 * turn))
    w += vibration * (0.02 * np.sin(turn + 0.5) + 0.02 * np.sin(2 * turn))
    return (ImuSample(*row) for row in np.column_stack([t, f, w]).tolist())


def _mag(motion: Motion, t: Floats, k: float, rng: np.random.Generator) -> Iterator[MagSample]:
    n = NUMBERS["mag"]
    m = motion.rotation(t).inv().apply(FIELD) + k * n["bias_std"] * rng.standard_normal(3)
    m += k * n["noise"] * rng.standard_normal(m.shape)
    return (MagSample(*row) for row in np.column_stack([t, m]).tolist())


def _baro(motion: Motion, t: Floats, k: float, recipe: Recipe, rng: np.random.Generator) -> Iterator[BaroSample]:
    n = NUMBERS["baro"]
    behind = t - n["lag"]
    h = motion.position(behind)[:, 2] + motion.rotation(behind).apply(MOUNTS["baro"])[:, 2]
    low = recipe.baro_downwash * np.exp(-np.maximum(0, h - 0.21) / 0.4)
    drift = wander(rng, len(t), 0.02, n["drift_std"], n["drift_tau"]) + n["bias_std"] * rng.standard_normal()
    h = h - low + k * (drift + n["noise"] * rng.standard_normal(len(t)))
    return (BaroSample(a, 101_325.0, 288.15, b) for a, b in zip(t.tolist(), h.tolist(), strict=True))


def _gps(motion: Motion, t: Floats, k: float, recipe: Recipe, rng: np.random.Generator) -> Iterator[GpsSample]:
    n, mount = NUMBERS["gps"], np.array(MOUNTS["gps"])
    rotation = motion.rotation(t)
    p = motion.position(t) + rotation.apply(mount)
    v = motion.position(t, 1) + rotation.apply(np.cross(motion.rates(t), mount))
    for axis, (name, white) in enumerate((("", 0.02), ("", 0.02), ("_up", 0.04))):
        slow = wander(rng, len(t), 0.2, n["wander_std" + name], n["wander_tau"])
        p[:, axis] += k * (n["bias_std" + name] * rng.standard_normal() + slow + white * rng.standard_normal(len(t)))
    v += k * n["velocity_noise"] * rng.standard_normal(v.shape)
    latency = recipe.latency["gps"]
    return (GpsSample(row[0], row[0] + latency, *row[1:], 9, 1.0, True) for row in np.column_stack([t, p, v]).tolist())


def _sonar(motion: Motion, t: Floats, k: float, recipe: Recipe, rng: np.random.Generator) -> Iterator[SonarSample]:
    rotation = motion.rotation(t)
    h = motion.position(t)[:, 2] + rotation.apply(MOUNTS["sonar"])[:, 2]
    tilt = np.arccos(rotation.as_matrix()[:, 2, 2])
    echo = h / np.cos(np.maximum(0, tilt - NUMBERS["sonar"]["beam_half_angle"]))
    measured = echo * (1 + k * (0.003 * rng.standard_normal() + 0.001 * rng.standard_normal(len(t))))
    measured = 0.003 * np.round(measured / 0.003) if k else measured
    false, where = rng.random(len(t)) < recipe.false_echoes, rng.uniform(0.15, 3.05, len(t))
    for i, a in enumerate(t.tolist()):
        if 0.15 <= echo[i] <= 3.05:
            yield SonarSample(a, float(measured[i]), True)
        elif false[i] and echo[i] > 3.05:
            yield SonarSample(a, float(where[i]), True)
        else:
            yield SonarSample(a, math.nan, False)


def _pad(motion: Motion, t: Floats, k: float, recipe: Recipe, rng: np.random.Generator) -> Iterator[PadSample | None]:
    equipment = make_equipment()
    mount = equipment.cameras["down"].mount
    rotation = motion.rotation(t)
    seen = (-rotation.inv().apply(motion.position(t)) - mount.position) @ mount.axes
    heading = motion.angles(t)[2]
    latency = recipe.latency["pad"]
    for i, a in enumerate(t.tolist()):
        x, y, z = seen[i]
        if z < recipe.pad_below or abs(x / z) > 0.40 or abs(y / z) > 0.30:
            yield None
            continue
        std = np.array([2e-4 * z + 2e-4, 2e-4 * z + 2e-4, 2e-4 * z + 2e-5 * z**2, 0.0015])
        error = k * std * rng.standard_normal(4)
        angle = math.pi / 2 - (math.pi / 2 + heading[i] - error[3]) % math.pi
        x, y, z = (seen[i] + error[:3]).tolist()
        yield PadSample(a, a + latency, x, y, z, angle, *std.tolist(), 1.0, "synthetic")


@pytest.fixture(scope="session")
def equipment() -> Equipment:
    return make_equipment()


@dataclass(frozen=True)
class Synthetic:
    """The functions above, handed to tests."""

    Recipe = Recipe
    fly = staticmethod(fly)
    quaternion = staticmethod(quaternion)
    tick = TICK


@pytest.fixture(scope="session")
def synthetic() -> Synthetic:
    return Synthetic()
