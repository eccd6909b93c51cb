"""A vehicle's sensors one by one, over truths that a test makes up."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from flightlog.atmosphere import SURFACE_PRESSURE, SURFACE_TEMPERATURE, pressure_at, temperature_at
from flightlog.constants import GRAVITY
from flightlog.marks import HMark
from flightlog.rotations import matrix, quaternion
from sim import vehicle
from sim.sensors import CATALOGUE
from sim.sensors.contract import Site, Truth

FIELD = np.array([1.5, 22.0, -42.0])  # [uT] ENU, with some declination
# what makes a sensor perfect; anything else about it stays as fitted
SILENT = ("noise", "_std", "_share", "vibration", "_noise", "resolution", "timer", "offset", "gain", "coefficient")


def make_truth(t: float = 0.0, **given: Any) -> Truth:
    """At rest, level, heading north, 10 m above the pad, unless told otherwise; roll, pitch, heading in rad."""
    attitude = [given.pop(name, 0.0) for name in ("roll", "pitch", "heading")]
    q = quaternion(*attitude)
    position = np.array(given.pop("position", (0.0, 0.0, 10.0)), float)
    rotation = matrix(q)
    values: dict[str, Any] = {
        "t": t,
        "position": position,
        "velocity": np.zeros(3),
        "quaternion": q,
        "rotation": rotation,
        "rates": np.zeros(3),
        "angular_acceleration": np.zeros(3),
        "specific_force": rotation.T @ np.array([0.0, 0.0, GRAVITY]),
        "rotor_speed": 157.08,
        "thrust": 49.0,
        "inflow": 3.4,
        "wind": np.zeros(3),
        "pressure": float(pressure_at(position[2], SURFACE_PRESSURE, SURFACE_TEMPERATURE)),
        "temperature": float(temperature_at(position[2], SURFACE_TEMPERATURE)),
    }
    return Truth(**{**values, **{name: np.array(value) if np.ndim(value) else value for name, value in given.items()}})


@dataclass
class Bench:
    """Builds sensors as the vehicle file fits them."""

    vehicle: vehicle.Vehicle
    site: Site

    def numbers(self, topic: str) -> dict[str, float]:
        """As fitted."""
        return dict(self.vehicle.sensors[topic].numbers)

    def build(self, topic: str, seed: int = 0, *, perfect: bool = False, position: Any = None, **changed: float) -> Any:
        """One sensor; `perfect`: all its errors off but those in `changed`."""
        numbers = self.numbers(topic)
        if perfect:
            off = {name for name in numbers if any(word in name for word in SILENT)}
            numbers |= dict.fromkeys(off, 0.0)
        kind: Any = CATALOGUE[topic]
        fitted = self.vehicle.sensors[topic]
        mount = fitted.position if position is None else np.array(position, float)
        options = {}
        if topic in ("pad", "flow"):
            camera = self.vehicle.cameras["down"]
            mount = camera.mount.position
            options = {"camera": camera.model, "mount": camera.mount}
            if topic == "pad":
                options["mark"] = HMark()
        return kind({**numbers, **changed}, mount, self.site, np.random.default_rng(seed), **options)

    def run(self, sensor: Any, count: int, truth: Callable[[float], Truth] = make_truth) -> Iterator[Any]:
        """`count` samples at the sensor's own rate."""
        period = 1.0 / sensor.numbers["rate"]
        for k in range(count):
            yield sensor.sample(truth(k * period))

    def rest(self, sensor: Any, count: int, **given: Any) -> Iterator[Any]:
        """`count` samples of one and the same truth, whose time goes on."""
        still = make_truth(**given)
        period = 1.0 / sensor.numbers["rate"]
        for k in range(count):
            still.t = k * period
            yield sensor.sample(still)


@pytest.fixture(scope="session")
def bench() -> Bench:
    raptor = vehicle.load("raptor90")
    return Bench(raptor, raptor.site(SURFACE_PRESSURE, SURFACE_TEMPERATURE, FIELD))


@pytest.fixture(scope="session")
def truth() -> Callable[..., Truth]:
    return make_truth
