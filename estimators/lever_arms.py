"""From where a sensor sits to the body origin, by the attitude at its time of validity. Compiled, one call a sample."""

import math

import numba
import numpy as np

from estimators.attitude_memory import attitude_at
from flightlog.rotations import matrix


@numba.njit(cache=True, error_model="numpy")
def antenna(memory, t, e, n, u, ve, vn, vu, mount):
    """Position [m] and velocity [m/s] (e, n, u, ve, vn, vu) of the body origin from those of an antenna at `mount`."""
    q, w = attitude_at(memory, t)
    r = matrix(q)
    turned = np.empty(3)
    turned[0] = w[1] * mount[2] - w[2] * mount[1]
    turned[1] = w[2] * mount[0] - w[0] * mount[2]
    turned[2] = w[0] * mount[1] - w[1] * mount[0]
    arm, speed = r @ mount, r @ turned
    return e - arm[0], n - arm[1], u - arm[2], ve - speed[0], vn - speed[1], vu - speed[2]


@numba.njit(cache=True, error_model="numpy")
def ranger(memory, distance, mount, half_angle):
    """(height of the body origin [m] that an echo at `distance` means, height of the ranger above the origin [m]).

    The nearest ground inside the beam answers: within half its opening of tilt that is the point straight below.
    """
    r = matrix(memory[0].q)
    lever = r[2, 0] * mount[0] + r[2, 1] * mount[1] + r[2, 2] * mount[2]
    tilt = math.acos(min(1.0, max(-1.0, r[2, 2])))
    return distance * math.cos(max(0.0, tilt - half_angle)) - lever, lever


@numba.njit(cache=True, error_model="numpy")
def pad_in_world(memory, t, x, y, z, covariance, mount, axes, grain, jitter, scale):
    """Position of the body origin over the mark's centre that a sighting means, and its covariance.

    x, y, z [m]: the centre in camera axes; covariance (3, 3); mount (3,), axes (3, 3) of the camera in the body.
    Returns e, n, u [m] and ee, en, nn, uu [m^2]. Added: `grain` [m] in all directions, `jitter` [rad] of the attitude
    times the distance, `scale` and heading error times the lateral distance, tilt error times it in height. Tilt error
    and scale times the height are states of the filters.
    """
    q, _ = attitude_at(memory, t)
    r = matrix(q)
    seen = np.empty(3)
    seen[0], seen[1], seen[2] = x, y, z
    arm = r @ (mount + axes @ seen)
    turn = r @ axes
    c = turn @ covariance @ turn.T
    e, n, u = -arm[0], -arm[1], -arm[2]
    a = memory[0]
    level, heading = a.variance_level, min(a.variance_heading, 2.0)  # unknown: anywhere on a circle
    fixed = grain * grain
    shaken = fixed + jitter * jitter * u * u
    c_ee = c[0, 0] + shaken + scale * scale * e * e + heading * n * n
    c_nn = c[1, 1] + shaken + scale * scale * n * n + heading * e * e
    c_en = c[0, 1] - heading * e * n
    c_uu = c[2, 2] + fixed + level * (e * e + n * n)
    return e, n, u, c_ee, c_en, c_nn, c_uu
