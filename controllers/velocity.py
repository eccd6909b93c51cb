"""Horizontal velocity to tilt: proportional and integral, in world axes, limited in tilt.

The demand is an acceleration, which the thrust gives by tilting: forward by a lowered nose, right by a lowered right
side. The integral stands for steady wind and for trims that are not as they were thought. The limit is on the rest, so
that a wind stronger than the limit can be met; at the limit the integral grows only as long as the machine does not
follow, which keeps it from winding up while a new place is flown to.

What the integral stands for is mostly the wind, and that falls off towards the ground. So it is carried from height to
height by the mean profile of MIL-F-8785C (section 3.7.3.4), in proportion to ln(h/z_0): in a descent through the last
metres the integral alone would come too late and let the machine creep into the wind.
"""

import math
from dataclasses import dataclass

from controllers.plant import SAMPLE_TIME
from flightlog.constants import GRAVITY

ACCELERATION_LAG = 0.5  # [s] of the low-pass behind the acceleration
ROUGHNESS = 0.15 * 0.3048  # [m] z_0 of the profile for take-off, approach and landing: 0.15 ft
PROFILE = (0.3, 30.0)  # [m] heights between which the profile is believed
OBEYED = 0.2  # [1] share of the acceleration at the limit that counts as following


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
        self._smooth_e = 0.0  # [m/s] velocity, low-passed, for the acceleration
        self._smooth_n = 0.0
        self._share = 1.0  # of the profile at the height now

    def take_over(self, ve: float, vn: float, roll: float, pitch: float, heading: float, height: float) -> None:
        """Begin from a steady flight: what it leans by now [rad] is taken for what the wind asks for."""
        right = GRAVITY * math.tan(roll - self._gains.trim_roll)
        forward = -GRAVITY * math.tan(pitch - self._gains.trim_pitch)
        sine, cosine = math.sin(heading), math.cos(heading)
        self._smooth_e, self._smooth_n = ve, vn
        self._share = _profile(height)
        self._hold_within(forward * sine + right * cosine, forward * cosine - right * sine)

    def update(
        self,
        wanted_e: float,
        wanted_n: float,
        ve: float,
        vn: float,
        heading: float,
        height: float,
        tilt_limit: float,
        level: float,
        hold: bool,
    ) -> tuple[float, float]:
        """(roll, pitch) wanted [rad].

        wanted_e, wanted_n, ve, vn: velocity wanted and velocity [m/s] ENU; heading [rad]; height [m] above the
        ground; tilt_limit [rad]: from what trim and steady wind ask for; level: 1 with the tail rotor pushing sideways
        as at trim, 0 without; hold: the integral rests.
        """
        gains = self._gains
        share = _profile(height)
        self._steady_e *= share / self._share
        self._steady_n *= share / self._share
        self._share = share
        lag_e, lag_n = ve - self._smooth_e, vn - self._smooth_n
        self._smooth_e += SAMPLE_TIME / ACCELERATION_LAG * lag_e
        self._smooth_n += SAMPLE_TIME / ACCELERATION_LAG * lag_n

        error_e, error_n = wanted_e - ve, wanted_n - vn
        ae, an = gains.proportional * error_e, gains.proportional * error_n
        size, most = math.hypot(ae, an), GRAVITY * math.tan(tilt_limit)
        if size > most:
            share = most / size
            ae, an = ae * share, an * share
            share = min(2.0 * share, 1.0)  # a larger error does not make the integral faster still
            error_e, error_n = error_e * share, error_n * share
            # at the limit, the integral rests while the limit does its work, and acts where it does not
            obeyed = (ae * lag_e + an * lag_n) / ACCELERATION_LAG
            hold = hold or obeyed > OBEYED * most * most
        if not hold:
            step = gains.integral * SAMPLE_TIME
            self._hold_within(self._steady_e + step * error_e, self._steady_n + step * error_n)
        ae += self._steady_e
        an += self._steady_n
        sine, cosine = math.sin(heading), math.cos(heading)
        forward, right = ae * sine + an * cosine, ae * cosine - an * sine
        return level * gains.trim_roll + math.atan(right / GRAVITY), gains.trim_pitch - math.atan(forward / GRAVITY)

    def _hold_within(self, steady_e: float, steady_n: float) -> None:
        share = min(1.0, self._gains.integral_limit / max(math.hypot(steady_e, steady_n), 1e-9))
        self._steady_e, self._steady_n = share * steady_e, share * steady_n


def _profile(height: float) -> float:
    return math.log(min(max(height, PROFILE[0]), PROFILE[1]) / ROUGHNESS)
