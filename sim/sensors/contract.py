"""The small contract that every simulated sensor obeys."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from flightlog.signals import Measurement
from sim.parameters import Parameter

Floats = NDArray[np.float64]


@dataclass(slots=True, eq=False)
class Truth:
    """What really is, at the end of a physics tick; the world updates one instance in place."""

    t: float  # [s]
    position: Floats  # (3,) [m] ENU, body origin
    velocity: Floats  # (3,) [m/s] ENU
    quaternion: Floats  # (4,) wxyz, body to world
    rotation: Floats  # (3, 3) body to world
    rates: Floats  # (3,) [rad/s] body axes
    angular_acceleration: Floats  # (3,) [rad/s^2] body axes
    specific_force: Floats  # (3,) [m/s^2] body axes, at the body origin, mean since the IMU's last sample
    rotor_speed: float  # [rad/s]
    thrust: float  # [N]
    inflow: float  # [m/s]
    wind: Floats  # (3,) [m/s] ENU, where the air moves to
    pressure: float  # [Pa] undisturbed static pressure at the body origin
    temperature: float  # [K]


@dataclass(frozen=True, eq=False)
class Site:
    """What a sensor may need to know of the place and the vehicle."""

    surface_pressure: float  # [Pa] at the pad
    surface_temperature: float  # [K]
    magnetic_field: Floats  # (3,) [uT] ENU
    rotor_radius: float  # [m]
    nominal_rotor_speed: float  # [rad/s]
    hub_height: float  # [m] of the hub above the body origin
    skid_height: float  # [m] body origin above the skids' plane


class Sensor(Protocol):
    """One device: called at each of its own sampling instants.

    Every sensor declares `rate` [Hz] (a divisor of 500) and `latency` [s] (default 0) among its PARAMETERS; `position`
    (3,) [m] is its mount in body axes. `numbers` holds a value for each of PARAMETERS by name, SI, and may be changed
    in flight by a scripted fault: read it at every sample. All randomness comes from `rng`; what the device draws for
    the whole flight (a bias) it draws in the constructor.
    """

    topic: ClassVar[str]
    PARAMETERS: ClassVar[tuple[Parameter, ...]]
    ERRORS: ClassVar[tuple[tuple[str, str], ...]]  # (name, unit) of its true fault states
    numbers: dict[str, float]

    def __init__(
        self, numbers: Mapping[str, float], position: Floats, site: Site, rng: np.random.Generator
    ) -> None: ...

    def sample(self, truth: Truth) -> Measurement | None:
        """What the device says of `truth`; None where it says nothing."""
        ...

    def errors(self) -> tuple[float, ...]:
        """The true fault states behind the last sample, in the order of ERRORS."""
        ...
