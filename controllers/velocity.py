"""Horizontal velocity to tilt: proportional and integral, in world axes, limited in tilt.

The demand is an acceleration, which the thrust gives by tilting: forward by a lowered nose, right by a lowered right
side. The integral stands for steady wind and for trims that are not as they were thought; it rests while the tilt is
at its limit and would grow further.
"""

import math
from dataclasses import dataclass

from controllers.plant import SAMPLE_TIME
from flightlog.constants import GRAVITY


@dataclass(frozen=True)
class VelocityGains:
    """Of the velocity loop."""

    proportional: float  # [1/s] m/s^2 per m/s
    integral: float  # [1/s^2]
    integral_limit: float  # [m/s^2]
    trim_roll: float  # [rad]
    trim_pitch: float  # [rad]


class VelocityLoop:
    """The loop in flight."""

    def __init__(self, gains: VelocityGains) -> None:
        self._gains = gains
        self._steady_e = 0.0  # [m/s^2] integral part
        self._steady_n = 0.0

    def update(
        self, error_e: float, error_n: float, heading: float, tilt_limit: float, level: float, hold: bool
    ) -> tuple[float, float]:
        """(roll, pitch) wanted [rad].

        error_e, error_n: velocity wanted less velocity [m/s] ENU; heading [rad]; tilt_limit: from trim [rad];
        level: 1 with the tail rotor pushing sideways as at trim, 0 without; hold: the integral rests.
        """
        gains = self._gains
        ae = gains.proportional * error_e + self._steady_e
        an = gains.proportional * error_n + self._steady_n
        size, most = math.hypot(ae, an), GRAVITY * math.tan(tilt_limit)
        if size > most:
            ae, an = ae * most / size, an * most / size
        if not hold:
            step = gains.integral * SAMPLE_TIME
            if size <= most or error_e * self._steady_e <= 0.0:
                self._steady_e = _limited(self._steady_e + step * error_e, gains.integral_limit)
            if size <= most or error_n * self._steady_n <= 0.0:
                self._steady_n = _limited(self._steady_n + step * error_n, gains.integral_limit)
        sine, cosine = math.sin(heading), math.cos(heading)
        forward, right = ae * sine + an * cosine, ae * cosine - an * sine
        return level * gains.trim_roll + math.atan(right / GRAVITY), gains.trim_pitch - math.atan(forward / GRAVITY)


def _limited(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
