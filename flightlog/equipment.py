"""The sensors as known aboard: what the navigator is told before the flight.

Nominal values from the vehicle file, never the errors that a flight draws.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import Mark

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SensorSpec:
    """One device as fitted."""

    rate: float  # [Hz]
    latency: float  # [s]
    position: Floats  # (3,) [m] body axes
    numbers: Mapping[str, float]  # every parameter of the vehicle file by name, SI

    def __getitem__(self, name: str) -> float:
        return self.numbers[name]


@dataclass(frozen=True, eq=False)
class CameraSpec:
    """One camera as fitted."""

    rate: float  # [Hz]
    latency: float  # [s]
    model: CameraModel
    mount: CameraMount
    colour: bool = True  # False: monochrome, pictures (H, W)
    # what an extended vehicle file knows to be wrong, of what flies; who sees with the camera does not look at it
    focal_scale: float = 1.0  # true focal length (that of `model`) over the one taken
    stamp_delay: float = 0.0  # [s] by which stamps are late
    k1_error: float = 0.0  # by which the true lens's k1 (that of `model`) exceeds the one taken


@dataclass(frozen=True, eq=False)
class Equipment:
    """Everything aboard that measures, and what was set on the pad before the flight."""

    sensors: Mapping[str, SensorSpec]  # by topic: imu, mag, baro, gps, sonar, rotor
    cameras: Mapping[str, CameraSpec]  # down, forward_a, forward_b
    mark: Mark | None  # on the pad; None: there is none
    skid_height: float  # [m] body origin above the skids' plane
    nominal_rotor_speed: float  # [rad/s]
    surface_pressure: float  # [Pa] as read on the pad
    surface_temperature: float  # [K]
    magnetic_field: Floats  # (3,) [uT] ENU at the pad
    horizon_dips: bool = False  # the horizon lies below elevation 0, as on the round earth
