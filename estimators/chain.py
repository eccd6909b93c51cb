"""The three filters in one compiled call: an inertial sample through all of them, and what they then say.

numba's cache knows a function by the text of its own file, not by that of what it calls: after a change to the kernels
of `attitude`, `replay` or `notch`, remove `__pycache__/chain.*` or the old ones go on flying.
"""

import math
from functools import cache

import numba
import numpy as np

from estimators import replay
from estimators.altitude import AltitudeFilter, AltitudeNoise
from estimators.attitude import coast, propagate
from estimators.attitude_memory import ATTITUDE
from estimators.heading import correct_axis, correct_azimuth
from estimators.lever_arms import antenna, pad_in_world, ranger
from estimators.position import PositionFilter, PositionNoise
from flightlog.constants import GRAVITY
from flightlog.rotations import angles

BLIND_NOISE = 100.0**2  # of the inputs, without inertial samples: about 1 m/s^2/sqrt(Hz) and 0.1 rad/sqrt(s)
ALIGNING_NOISE = 15.0**2  # until aligned
AID_FULL, AID_NONE = 0.6, 1.5  # [s] age of the last fix up to which, and from which on not, it levels the attitude


@numba.njit(cache=True, error_model="numpy")
def step(attitude, height, place, t, fx, fy, fz, wx, wy, wz, present):
    """One inertial sample through the three filters; where it is not `present`, on to `t` without one."""
    a, p = attitude[0], place[0]
    if present:
        last = p.ring[(p.epochs - 1) % p.ring.shape[0]]
        newest = -math.inf
        for topic in range(last.accepted.shape[0]):
            newest = max(newest, last.accepted[topic])
        aid = min(1.0, max(0.0, (AID_NONE - (t - newest)) / (AID_NONE - AID_FULL)))
        # what is known of the error and not yet turned back is an error still
        variance = 0.5 * (last.p[4, 4] + last.p[5, 5] + last.x[4] ** 2 + last.x[5] ** 2)
        propagate(attitude, t, fx, fy, fz, wx, wy, wz, last.x[4], last.x[5], variance, aid)
        # until it is aligned the acceleration is taken for none, as in trimmed flight
        noise = 1.0 if a.aligned == 1 else ALIGNING_NOISE
    else:
        coast(attitude, t)
        noise = BLIND_NOISE
    replay.advance(height, t, a.inputs, noise)
    replay.advance(place, t, a.inputs, noise)


@numba.njit(cache=True, error_model="numpy")
def report(attitude, height, place):
    """Everything that a StateEstimate holds, in a row (32,); see `Navigator`."""
    a, h, p = attitude[0], height[0], place[0]
    v, s = h.ring[(h.epochs - 1) % h.ring.shape[0]], p.ring[(p.epochs - 1) % p.ring.shape[0]]
    out = np.empty(32)
    out[0], out[1], out[2] = s.x[0], s.x[1], v.x[0]
    out[3], out[4], out[5] = s.x[2], s.x[3], v.x[1]
    f = a.mean_acceleration
    out[6], out[7], out[8] = f[0] - GRAVITY * s.x[4] - s.x[6], f[1] - GRAVITY * s.x[5] - s.x[7], f[2] - v.x[2]
    out[9:13] = a.q
    out[13:16] = a.rates
    for i in range(2):
        out[16 + i] = math.sqrt(s.p[i, i])
        out[19 + i] = math.sqrt(s.p[2 + i, 2 + i])
        out[22 + i] = math.sqrt(a.variance_level)
    out[18], out[21], out[24] = math.sqrt(v.p[0, 0]), math.sqrt(v.p[1, 1]), math.sqrt(a.variance_heading)
    out[25], out[26], out[27] = angles(a.q)
    out[28] = a.t
    out[29] = a.rotor_speed
    out[30] = a.t - s.accepted[2]
    out[31] = a.t - max(v.accepted[1], v.accepted[2], v.accepted[3])
    return out


@cache
def compile_all(epochs: int) -> None:
    """Have all compiled before the flight: each function is called once, on memories `epochs` long that fly nowhere."""
    attitude = np.zeros(1, ATTITUDE)
    attitude["period"], attitude["aligned"], attitude["notch_speed"] = 0.004, 1, 1.0
    high, side = AltitudeFilter(AltitudeNoise(), 0.0, epochs), PositionFilter(PositionNoise(), 0.0, epochs)
    step(attitude, high.kalman.memory, side.kalman.memory, 0.004, 0.0, 0.0, 9.8, 0.0, 0.0, 0.0, True)
    correct_azimuth(attitude, 0.0, 0.0, 20.0, -40.0)
    correct_axis(attitude, 0.0, 0.0, 0.01)
    place, axes = np.zeros(3), np.eye(3)
    antenna(attitude, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, place)
    ranger(attitude, 1.0, place, 0.1)
    pad_in_world(attitude, 0.0, 0.0, 0.0, 1.0, axes, place, axes, 0.0, 0.0, 0.0)
    high.vision(0.002, 1.0, 1.0)
    side.vision(0.002, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0)
    for kalman in (high.kalman, side.kalman):
        kalman.refresh()
        kalman.state_at(0.003)
    report(attitude, high.kalman.memory, side.kalman.memory)
