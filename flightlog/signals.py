"""What flows around the loop: measurements, controls and states.

SI units and radians. t is the time of validity [s]; t_arrival, where a sensor is late, the time at which the
sample reaches the flight computer. World axes ENU, body axes x forward, y left, z up, quaternions wxyz body to world.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Controls(NamedTuple):
    """A helicopter's controls as sent, before servo and delay [rad]; throttle [0..1]."""

    collective: float = 0.0  # > 0: more lift
    lateral: float = 0.0  # > 0: rolls right
    longitudinal: float = 0.0  # > 0: pitches nose down
    tail: float = 0.0  # > 0: yaws nose right
    throttle: float = 0.0  # > 0: more power


class ImuSample(NamedTuple):
    """Specific force [m/s^2] and angular rate [rad/s] in body axes."""

    t: float
    fx: float
    fy: float
    fz: float
    wx: float
    wy: float
    wz: float


class MagSample(NamedTuple):
    """Magnetic field [uT] in body axes."""

    t: float
    mx: float
    my: float
    mz: float


class BaroSample(NamedTuple):
    """Static pressure [Pa], its temperature [K], and the height above the pad by equation 8 [m]."""

    t: float
    pressure: float
    temperature: float
    altitude: float


class GpsSample(NamedTuple):
    """Position of the antenna [m] from the pad's centre, and velocity [m/s], ENU."""

    t: float
    t_arrival: float
    e: float
    n: float
    u: float
    ve: float
    vn: float
    vu: float
    satellites: int
    hdop: float
    valid: bool


class SonarSample(NamedTuple):
    """Echo range along the beam [m]; `valid` is what the device itself says."""

    t: float
    range: float
    valid: bool


class RotorSample(NamedTuple):
    """Main rotor speed [rad/s]."""

    t: float
    speed: float


class PadSample(NamedTuple):
    """The mark's centre [m] in camera axes as the front end saw it.

    angle [rad]: the mark's axis clockwise from image up, in (-pi/2, pi/2] for an H, in (-pi, pi] for a ring; NaN where
    the mark has none.
    quality [0..1]; source: the front end that saw it.
    """

    t: float
    t_arrival: float
    x: float
    y: float
    z: float
    angle: float
    std_x: float
    std_y: float
    std_z: float
    std_angle: float
    quality: float
    source: str


class HorizonSample(NamedTuple):
    """Roll and pitch [rad] from the horizon."""

    t: float
    t_arrival: float
    roll: float
    pitch: float
    std_roll: float
    std_pitch: float
    valid: bool


class FlowSample(NamedTuple):
    """Image motion [rad] over the last dt [s], along camera x and y, before rotation is removed.

    u, v are those of the principal point's surroundings: tangents of the angles by which the picture moved.
    quality [0..1]; 0: nothing to match, u and v are NaN.
    """

    t: float
    t_arrival: float
    dt: float
    u: float
    v: float
    quality: float


@dataclass(frozen=True, eq=False, slots=True)
class Frame:
    """One picture; `image` is (H, W) or (H, W, 3) RGB, uint8."""

    t: float
    t_arrival: float
    camera: str
    image: NDArray[np.uint8]


Measurement = (
    ImuSample
    | MagSample
    | BaroSample
    | GpsSample
    | SonarSample
    | RotorSample
    | PadSample
    | HorizonSample
    | FlowSample
    | Frame
)


@dataclass(frozen=True, eq=False, slots=True)
class StateEstimate:
    """What the navigator believes at time t; the pilot sees nothing else."""

    t: float
    position: Floats  # (3,) [m] ENU, body origin from the pad's centre
    velocity: Floats  # (3,) [m/s] ENU
    acceleration: Floats  # (3,) [m/s^2] ENU, gravity removed
    quaternion: Floats  # (4,) wxyz, body to world
    roll: float  # [rad]
    pitch: float  # [rad]
    heading: float  # [rad]
    rates: Floats  # (3,) [rad/s] body axes, bias removed
    rotor_speed: float  # [rad/s]
    std_position: Floats  # (3,) [m]
    std_velocity: Floats  # (3,) [m/s]
    std_attitude: Floats  # (3,) [rad] roll, pitch, heading
    pad_age: float  # [s] since the mark was last seen; inf before the first time
    height_age: float  # [s] since any sensor other than the barometer corrected the height
