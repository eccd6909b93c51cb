"""What the attitude filter remembers: one record, and the history in it from which late samples get their attitude."""

import math

import numba
import numpy as np

from flightlog.rotations import from_vector, multiply

HISTORY = 512  # samples kept for late pictures: 2 s at 250 Hz
INPUTS = 5
CHANNELS = 6  # force and rate, three axes each, run through the notches
HARMONICS = 2

ATTITUDE = np.dtype(
    [
        ("t", "f8"),  # [s] of the last sample
        ("samples", "i8"),
        ("aligned", "i8"),
        ("q", "f8", (4,)),  # wxyz, body to world
        ("bias", "f8", (3,)),  # [rad/s] of the gyroscopes
        ("raw_rate", "f8", (3,)),  # [rad/s] last sample, bias removed
        ("rates", "f8", (3,)),  # [rad/s] bias removed, through the notches, mean of two samples
        # what the filters of position and height integrate: acceleration R f + g [m/s^2] ENU, through the notches, and
        # how fast the correction turns the tilt error d [rad/s] east, north
        ("inputs", "f8", (INPUTS,)),
        ("mean_acceleration", "f8", (3,)),  # [m/s^2] the same, mean of two samples
        ("quiet_rate", "f8", (3,)),  # [rad/s] last sample, bias removed, through the notches
        ("plumb", "f8", (3,)),  # [m/s^2] slow mean of R f
        ("field", "f8", (3,)),  # [uT] body axes, sum until aligned
        ("force", "f8", (3,)),  # [m/s^2] body axes, sum until aligned
        ("fields", "i8"),
        ("start", "f8"),  # [s] of the first sample
        ("variance_level", "f8"),  # [rad^2]
        ("variance_heading", "f8"),  # [rad^2]
        ("yaw_error", "f8"),  # [rad] estimated minus measured, counter-clockwise
        ("yaw_time", "f8"),  # [s] when that was measured
        ("axis_error", "f8"),  # [rad] the same by a mark's axis alone, where that is much the better
        ("axis_time", "f8"),  # [s] when that was seen
        ("axis_variance", "f8"),  # [rad^2]
        ("deviation", "f8"),  # [rad] azimuth by magnetometer minus true, counter-clockwise
        ("variance_deviation", "f8"),  # [rad^2]
        ("deviation_time", "f8"),  # [s]
        ("rotor_speed", "f8"),  # [rad/s]
        ("notch_speed", "f8"),  # [rad/s] for which the notches stand
        ("notch", "f8", (HARMONICS, 5)),
        ("notch_memory", "f8", (CHANNELS, HARMONICS, 2)),
        ("times", "f8", (HISTORY,)),
        ("quaternions", "f8", (HISTORY, 4)),
        ("turning", "f8", (HISTORY, 3)),  # [rad/s] rates of that time, through the notches: 25 Hz of vibration looks
        # like a steady turn to a GPS at 5 Hz
        # settings
        ("period", "f8"),  # [s] of the inertial sensor
        ("mount", "f8", (3,)),  # [m] its place, body axes
        ("earth_field", "f8", (3,)),  # [uT] ENU
        ("nominal_speed", "f8"),  # [rad/s] of the rotor
        ("gain", "f8"),  # [1/s] proportional, level
        ("integral", "f8"),  # [1/s] share of the levelling that goes to the gyroscopes' bias
        ("gain_heading", "f8"),  # [1/s]
        ("gain_axis", "f8"),  # [1/s] the same by a mark's axis
        ("gain_unaided", "f8"),  # [1/s] level, by the plumb line
        ("bias_limit", "f8"),  # [rad/s]
        ("floor_level", "f8"),  # [rad] what b/g and misalignment leave
        ("floor_heading", "f8"),  # [rad] of the magnetometer alone
        ("field_noise", "f8"),  # [rad] of one magnetometer sample's azimuth
        ("gyro_std", "f8"),  # [rad/s] unknown bias
    ],
    align=True,
)


@numba.njit(cache=True, error_model="numpy")
def remember(a):
    """Put the present attitude into the history."""
    i = a.samples % HISTORY
    a.times[i] = a.t
    a.quaternions[i, :] = a.q
    a.turning[i, :] = a.quiet_rate
    a.samples += 1


@numba.njit(cache=True, error_model="numpy")
def look_back(a):
    """Carry the attitude found back over the samples from which it was found."""
    for k in range(a.samples - 2, max(0, a.samples - HISTORY) - 1, -1):
        i, j = k % HISTORY, (k + 1) % HISTORY
        dt = a.times[j] - a.times[i]
        a.quaternions[i, :] = multiply(a.quaternions[j], from_vector(-0.5 * dt * (a.turning[i] + a.turning[j])))


@numba.njit(cache=True, error_model="numpy")
def attitude_at(memory, t):
    """(quaternion (4,), rates (3,)) at the time `t` [s], interpolated; the nearest end's outside the history."""
    a = memory[0]
    newest = a.samples - 1
    oldest = max(0, a.samples - HISTORY)
    k = newest
    while k > oldest and a.times[k % HISTORY] > t:
        k -= 1
    i, j = k % HISTORY, min(k + 1, newest) % HISTORY
    q, w = a.quaternions[i].copy(), a.turning[i].copy()
    span = a.times[j] - a.times[i]
    if span <= 0.0 or t <= a.times[i]:
        return q, w
    share = min(1.0, (t - a.times[i]) / span)
    # neighbours are 4 ms apart: the chord is the arc
    sign = 1.0 if q[0] * a.quaternions[j, 0] + q[1] * a.quaternions[j, 1] + q[2] * a.quaternions[j, 2] + q[
        3
    ] * a.quaternions[j, 3] > 0.0 else -1.0  # fmt: skip
    size = 0.0
    for c in range(4):
        q[c] = (1.0 - share) * q[c] + share * sign * a.quaternions[j, c]
        size += q[c] * q[c]
    for c in range(4):
        q[c] /= math.sqrt(size)
    for c in range(3):
        w[c] = (1.0 - share) * w[c] + share * a.turning[j, c]
    return q, w
