"""Horizontal position to velocity demand, and the gains of position and velocity as one regulator.

Design: a point that is accelerated by tilting, the tilt following its demand with a lag; LQR on the integral of the
position error, position, velocity and tilt. The regulator's polynomial is then split into the cascade that flies,

    v = k_p (p* - p),   a = k_v (v - v_now) + k_i integral (v - v_now),

so that speed and tilt can be limited on the way: same zeros, k_p the faster one.
"""

import math
from dataclasses import dataclass

import numpy as np

from controllers.plant import LinearPlant
from controllers.regulator import bryson, lqr
from controllers.velocity import VelocityGains
from flightlog.constants import GRAVITY

TILT_LAG = 0.35  # [s] of the attitude loop, its group delay at low frequency
INTEGRAL, POSITION, VELOCITY, TILT = 1.6, 0.36, 0.36, 0.10  # Bryson's largest values [m s], [m], [m/s], [rad]
TILT_DEMAND = 0.050  # [rad]
STEADY_LIMIT = 1.2  # [m/s^2] integral part: as much as a wind of 9 m/s from the side asks for


@dataclass(frozen=True)
class PositionGains:
    """Of the position loop."""

    proportional: float  # [1/s] m/s per m


def design_horizontal(plant: LinearPlant) -> tuple[PositionGains, VelocityGains]:
    """Gains of both loops, alike along and across."""
    a = np.zeros((4, 4))  # integral of position, position, velocity, tilt
    a[0, 1] = a[1, 2] = 1.0
    a[2, 3] = GRAVITY
    a[3, 3] = -1.0 / TILT_LAG
    b = np.array([[0.0], [0.0], [0.0], [1.0 / TILT_LAG]])
    weights = bryson(INTEGRAL, POSITION, VELOCITY, TILT)
    integral, position, velocity, tilt = lqr(a, b, weights, bryson(TILT_DEMAND))[0].tolist()
    scale = GRAVITY / (1.0 + tilt)  # tilt is taken as following its demand
    k_v, faster, slower = split(scale * integral, scale * position, scale * velocity)
    return PositionGains(faster), VelocityGains(k_v, k_v * slower, STEADY_LIMIT, plant.trim_roll, plant.trim_pitch)


def split(integral: float, proportional: float, derivative: float) -> tuple[float, float, float]:
    """(d, faster, slower) with d (s + faster)(s + slower) = d s^2 + p s + i; ValueError where the zeros are complex."""
    room = proportional * proportional - 4.0 * integral * derivative
    if room < 0.0:
        raise ValueError("integral action too strong to be a cascade: its zeros are complex")
    faster = (proportional + math.sqrt(room)) / (2.0 * derivative)
    return derivative, faster, integral / (derivative * faster)


class PositionLoop:
    """The loop in flight."""

    def __init__(self, gains: PositionGains) -> None:
        self._gain = gains.proportional

    def update(self, error_e: float, error_n: float, speed_limit: float) -> tuple[float, float]:
        """Velocity wanted (e, n) [m/s] for a position error [m], at most `speed_limit` [m/s]."""
        ve, vn = self._gain * error_e, self._gain * error_n
        speed = math.hypot(ve, vn)
        if speed > speed_limit:
            ve, vn = ve * speed_limit / speed, vn * speed_limit / speed
        return ve, vn
