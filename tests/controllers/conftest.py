"""A helicopter to fly in tests: the model's terms on a rigid body with four sprung skid points, and its plant."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numba
import numpy as np
import pytest

from controllers.gains import Gains, design
from controllers.pilot import Pilot
from controllers.plant import SAMPLE_TIME, LinearPlant
from flightlog.atmosphere import SURFACE_PRESSURE, SURFACE_TEMPERATURE
from flightlog.constants import GRAVITY
from flightlog.rotations import angles, from_vector, matrix, multiply, quaternion
from flightlog.signals import Controls, StateEstimate
from scenarios.crew import plant_of
from sim.linearisation import Trim, trim
from sim.motion import advance
from sim.pipeline import Pipeline
from sim.terms.contract import GEOMETRY, SIGNALS
from sim.vehicle import Vehicle, load
from sim.weather import Weather
from sim.wind import Gust, Wind

TICK = 0.002  # [s]
SKIDS = np.array([[x, y, -0.23] for x in (-0.25, 0.25) for y in (-0.15, 0.15)])
STIFFNESS, DAMPING, FRICTION = 8000.0, 300.0, 0.6  # [N/m], [N s/m], [1] at each skid point


@numba.njit(cache=True)
def _move(qpos, qvel, qfrc, inertia, mass, dt, skids, touching):  # type: ignore[no-untyped-def]
    """Semi-implicit Euler of a rigid body with gravity and sprung skids; `touching[0]`: points on the ground."""
    r = matrix(qpos[3:7])
    force, moment = qfrc[:3].copy(), qfrc[3:6].copy()
    force[2] -= mass * GRAVITY
    rates = qvel[3:6].copy()
    touching[0] = 0.0
    for k in range(len(skids)):
        arm = skids[k]
        depth = -(qpos[2] + r[2, 0] * arm[0] + r[2, 1] * arm[1] + r[2, 2] * arm[2])
        if depth <= 0.0:
            continue
        touching[0] += 1.0
        velocity = qvel[:3] + r @ np.cross(rates, arm)
        normal = max(STIFFNESS * depth - DAMPING * velocity[2], 0.0)
        slip = math.hypot(velocity[0], velocity[1]) + 1e-3
        grip = min(FRICTION * normal / slip, DAMPING)
        push = np.array([-grip * velocity[0], -grip * velocity[1], normal])
        force += push
        moment += np.cross(arm, r.T @ push)
    qvel[:3] += dt * force / mass
    qvel[3:6] += dt * (moment - np.cross(rates, inertia * rates)) / inertia
    qpos[:3] += dt * qvel[:3]
    turned = multiply(qpos[3:7], from_vector(dt * qvel[3:6]))
    qpos[3:7] = turned / math.sqrt((turned**2).sum())


@dataclass
class Noise:
    """Standard deviations of what the state estimate is off by, white and slowly wandering (1 s)."""

    position: float = 0.0  # [m]
    velocity: float = 0.0  # [m/s]
    attitude: float = 0.0  # [rad]
    rates: float = 0.0  # [rad/s]
    wander: float = 0.0  # [m] of the position


@dataclass
class Flight:
    """One flight: the model, its motion, and what was recorded of it."""

    vehicle: Vehicle
    pipeline: Pipeline
    at: Trim
    wind: Wind | None = None
    noise: Noise = field(default_factory=Noise)
    seed: int = 0
    rows: list[list[float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.qpos = np.array([0.0, 0.0, 10.0, *quaternion(self.at.roll, self.at.pitch, self.at.heading)])
        self.qvel = np.zeros(6)
        self.qfrc = np.zeros(6)
        self.touching = np.zeros(1)
        self.air = np.zeros(3)
        self.t = 0.0
        self._signals = np.array([self.at.signals], dtype=SIGNALS)
        self._geometry = np.array([self.pipeline.geometry], dtype=GEOMETRY)
        self.signals = self._signals[0]  # a view
        self.pipeline.state[:] = self.at.state
        self.controls = self.at.controls
        self.pad_age = 0.0
        self._wander = np.zeros(3)

    def estimate(self) -> StateEstimate:
        rng, noise = self.rng, self.noise
        roll, pitch, heading = angles(self.qpos[3:7])
        off = noise.attitude * rng.standard_normal(3)
        share = SAMPLE_TIME / 1.0
        self._wander += -share * self._wander + noise.wander * math.sqrt(2 * share) * rng.standard_normal(3)
        return StateEstimate(
            t=self.t,
            position=self.qpos[:3] + self._wander + noise.position * rng.standard_normal(3),
            velocity=self.qvel[:3] + noise.velocity * rng.standard_normal(3),
            acceleration=np.zeros(3),
            quaternion=self.qpos[3:7].copy(),
            roll=roll + off[0],
            pitch=pitch + off[1],
            heading=heading + off[2],
            rates=self.qvel[3:6] + noise.rates * rng.standard_normal(3),
            rotor_speed=float(self.signals["rotor_speed"]),
            std_position=np.full(3, 0.03),
            std_velocity=np.full(3, 0.03),
            std_attitude=np.full(3, 0.005),
            pad_age=self.pad_age,
            height_age=0.0,
        )

    def step(self, controls: Controls) -> None:
        self.controls = controls
        if self.wind is not None:
            airspeed = math.hypot(self.qvel[0] - self.air[0], self.qvel[1] - self.air[1])
            self.air = self.wind.step(float(self.qpos[2]), airspeed, SAMPLE_TIME, self.t)
        model = self.pipeline
        for _ in range(2):
            advance(
                model.kernels, model.spans, self._signals, self._geometry, model.state, model.parameters, TICK,
                self.qpos, self.qvel, self.air, SURFACE_PRESSURE, SURFACE_TEMPERATURE, tuple(controls), np.zeros(6),
                self.qfrc,
            )  # fmt: skip
            _move(
                self.qpos, self.qvel, self.qfrc, self.at.inertia, float(self.signals["mass"]), TICK, SKIDS,
                self.touching,
            )  # fmt: skip
        self.t += SAMPLE_TIME

    def fly(self, pilot: Pilot, duration: float, each: Callable[["Flight"], None] | None = None) -> None:
        """Close the loop; every period is a row of `rows`, see `column`."""
        while self.t < duration and not pilot.finished:
            if each is not None:
                each(self)
            controls = pilot.update(self.estimate())
            self.step(controls)
            self.rows.append(
                [
                    self.t, *self.qpos[:3], *self.qvel[:3], *angles(self.qpos[3:7]), *self.qvel[3:6],
                    float(self.signals["rotor_speed"]), *controls, self.touching[0],
                ]
            )  # fmt: skip

    COLUMNS = (
        "t", "e", "n", "u", "ve", "vn", "vu", "roll", "pitch", "heading", "wx", "wy", "wz", "rotor", "collective",
        "lateral", "longitudinal", "tail", "throttle", "contacts",
    )  # fmt: skip

    def column(self, name: str) -> np.ndarray:
        return np.array(self.rows)[:, self.COLUMNS.index(name)]


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    return load("raptor90")


@pytest.fixture(scope="session")
def hover_trim(vehicle: Vehicle) -> Trim:
    return trim(Pipeline(vehicle.terms, vehicle.parameters, vehicle.geometry), vehicle.inertia)


@pytest.fixture(scope="session")
def plant(vehicle: Vehicle) -> LinearPlant:
    return plant_of(vehicle, SURFACE_PRESSURE, SURFACE_TEMPERATURE)


@pytest.fixture(scope="session")
def gains(plant: LinearPlant) -> Gains:
    return design(plant)


@pytest.fixture
def fly(vehicle: Vehicle, hover_trim: Trim) -> Callable[..., Flight]:
    """Opens a flight trimmed at (0, 0, 10): wind [m/s] with its turbulence, noise, seed."""

    def new(wind: float = 0.0, noise: Noise | None = None, seed: int = 0, gust: Gust | None = None) -> Flight:
        air = None
        if wind or gust is not None:
            air = Wind(Weather(wind=wind), np.random.default_rng([seed, 1]))
            if gust is not None:
                air.add(gust)
        model = Pipeline(vehicle.terms, vehicle.parameters, vehicle.geometry)
        return Flight(vehicle, model, hover_trim, air, noise or Noise(), seed)

    return new
