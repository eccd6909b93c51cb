"""Heading: the field's horizontal part against the known one, and the mark's axis, which points north.

What the calibration of the magnetometer left, its deviation, is learnt from the mark while a front end sees it. An axis
that is seen much better than the field is felt turns the heading by itself, and faster.
"""

import math

import numba
import numpy as np

from estimators.attitude_memory import attitude_at
from flightlog.rotations import angles, from_vector, matrix, multiply, quaternion, wrap

DEVIATION_TAU = 60.0  # [s] the magnetometer's deviation changes in: drift, and turns of the nose
CLEAR = 0.3  # of the noise of one azimuth by magnetometer: an axis better than that is followed by itself
MEASURED_FOR = 0.2  # [s] an azimuth stays in force until the next one


@numba.njit(cache=True, error_model="numpy")
def align(a):
    """Attitude of level flight without acceleration from the means of force and field so far."""
    fx, fy, fz = a.force[0], a.force[1], a.force[2]
    length = math.sqrt(fx * fx + fy * fy + fz * fz)
    if length < 1e-3:
        return
    # the force's direction is the world's up in body axes: (sin pitch, cos pitch sin roll, cos pitch cos roll)
    pitch = math.asin(max(-1.0, min(1.0, fx / length)))
    roll = math.atan2(fy, fz)
    q = quaternion(roll, pitch, 0.5 * math.pi)
    if a.fields > 0:
        level = matrix(q) @ a.field
        yaw = math.atan2(a.earth_field[1], a.earth_field[0]) - math.atan2(level[1], level[0])
        q = quaternion(roll, pitch, 0.5 * math.pi - yaw)
        a.variance_heading = a.floor_heading**2
    a.q[:] = q


@numba.njit(cache=True, error_model="numpy")
def correct_azimuth(memory, t, mx, my, mz):
    """One magnetometer sample [uT]."""
    a = memory[0]
    if a.aligned == 0:
        a.field[0] += mx
        a.field[1] += my
        a.field[2] += mz
        a.fields += 1
        if a.samples > 0:
            align(a)
        return
    r = matrix(a.q)
    e = r[0, 0] * mx + r[0, 1] * my + r[0, 2] * mz
    n = r[1, 0] * mx + r[1, 1] * my + r[1, 2] * mz
    error = wrap(math.atan2(n, e) - math.atan2(a.earth_field[1], a.earth_field[0]))
    if a.fields == 0:  # the first field of all: the heading was a guess
        turn = np.zeros(3)
        turn[2] = -error
        a.q[:] = multiply(from_vector(turn), a.q)
        a.variance_heading = a.floor_heading**2
        error = 0.0
    a.fields += 1
    # the deviation that the mark has shown
    spread = a.variance_deviation
    if spread < a.floor_heading**2:
        error += a.deviation
    a.yaw_error = wrap(error)
    a.yaw_time = t


@numba.njit(cache=True, error_model="numpy")
def correct_axis(memory, t, angle, std):
    """The mark's axis, which points north, seen `angle` [rad] clockwise from forward at the time `t`."""
    a = memory[0]
    q, _ = attitude_at(memory, t)
    _, _, heading = angles(q)
    # the heading is -angle modulo pi; yaw runs against it
    error = -angle - heading
    error -= math.pi * math.floor(error / math.pi + 0.5)
    if std < CLEAR * a.field_noise and a.variance_heading < 0.3:
        a.axis_error, a.axis_time, a.axis_variance = error, a.t, std * std
    if a.t - a.yaw_time < MEASURED_FOR and a.fields > 0:
        # azimuth error by magnetometer, without the deviation in force, against that by vision
        in_force = a.deviation if a.variance_deviation < a.floor_heading**2 else 0.0
        value = error - (a.yaw_error - in_force)
        grown = min(1.0, max(0.0, (t - a.deviation_time) / DEVIATION_TAU)) * a.floor_heading**2
        a.variance_deviation = min(a.floor_heading**2, a.variance_deviation + grown)
        noise = std * std + a.field_noise**2
        gain = a.variance_deviation / (a.variance_deviation + noise)
        a.deviation += gain * (value - a.deviation)
        a.variance_deviation *= 1.0 - gain
        a.deviation_time = t
    elif std < 0.1 and a.variance_heading < 0.3:
        a.yaw_error = error
        a.yaw_time = a.t
