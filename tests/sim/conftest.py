"""The vehicle that comes with the project, and models made of some of its terms."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from flightlog.constants import GRAVITY
from flightlog.rotations import from_vector, matrix, multiply, quaternion
from flightlog.signals import Controls
from sim import vehicle
from sim.linearisation import Trim, trim
from sim.pipeline import Pipeline
from sim.terms import CATALOGUE


@pytest.fixture(scope="session")
def raptor() -> vehicle.Vehicle:
    return vehicle.load("raptor90")


@pytest.fixture
def model(raptor) -> Callable[..., Pipeline]:
    """`model()` is the whole vehicle; `model("engine", ...)` these terms alone; `without=` all but those."""

    def build(*names: str, without: Sequence[str] = (), direction: float | None = None) -> Pipeline:
        geometry = raptor.geometry.copy()
        if direction is not None:
            geometry["rotor_direction"] = direction
        chosen = [name for name in (names or raptor.parameters) if name not in without]
        return Pipeline([CATALOGUE[name] for name in chosen], raptor.parameters, geometry)

    return build


@pytest.fixture
def hover(raptor, model) -> Callable[..., tuple[Pipeline, Trim]]:
    """A model and its trim in hover."""

    def find(pipeline: Pipeline | None = None, **where) -> tuple[Pipeline, Trim]:
        pipeline = pipeline or model()
        return pipeline, trim(pipeline, raptor.inertia, **where)

    return find


class Body:
    """A rigid body under a model's wrench, integrated by hand (semi-implicit Euler)."""

    def __init__(self, pipeline: Pipeline, at: Trim, dt: float = 0.002) -> None:
        self.dt = dt
        self.pipeline, self.inertia, self.wind = pipeline, at.inertia, at.wind
        self.s = at.signals.copy()
        pipeline.state[:] = at.state
        self.q = quaternion(at.roll, at.pitch, at.heading)
        self.position = np.array([0.0, 0.0, float(at.signals["height"])])
        self.velocity = at.velocity.copy()
        self.rates = np.zeros(3)

    def step(self, controls: Controls) -> None:
        r, s = matrix(self.q), self.s
        s["velocity"], s["rates"], s["up"] = r.T @ (self.velocity - self.wind), self.rates, r[2]
        s["height"] = self.position[2]
        for name, value in controls._asdict().items():
            s[name] = value
        self.pipeline.run(s, self.dt)
        self.velocity = self.velocity + self.dt * (r @ s["force"] / s["mass"] - np.array([0.0, 0.0, GRAVITY]))
        spin = s["moment"] - np.cross(self.rates, self.inertia * self.rates)
        self.rates = self.rates + self.dt * spin / self.inertia
        self.position = self.position + self.dt * self.velocity
        self.q = multiply(self.q, from_vector(self.dt * self.rates))


@pytest.fixture
def body() -> type[Body]:
    return Body
