"""Attitude from rates, specific force and magnetic field: a complementary filter with proportional and integral way.

The rates are integrated (quaternion, trapezoidal rule); what the other sensors say of the error turns the estimate
slowly back and, slower still, corrects the gyroscopes' bias (Mahony, Hamel, Pflimlin 2008, equation 48).

Level: manoeuvres make the accelerometer a bad plumb line, so the filter does not take it for one while velocity or
position are measured: the position filter finds the tilt error d, as a vector so that R f is off by g d. Without that
aid the mean of R f itself is the plumb line, used only while it is about as long as gravity.

Heading: the horizontal direction of the field against the known one. The deviation that the calibration of the
magnetometer left is learnt from the mark's axis (which points north, modulo pi) while a front end sees it.

What the accelerometer's bias b does to the level, b/g, no aid can tell from a tilt while hovering.
"""

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from estimators import notch
from estimators.attitude_memory import ATTITUDE, CHANNELS, HARMONICS, attitude_at, look_back, remember
from estimators.heading import MEASURED_FOR, align
from flightlog.constants import GRAVITY
from flightlog.equipment import Equipment
from flightlog.rotations import from_vector, matrix, multiply

Floats = NDArray[np.float64]

ALIGNMENT = 0.2  # [s] five turns of the rotor: the vibration averages out
ALIGNED = 0.012  # [rad] tilt error that is left: trimmed flight is not quite without acceleration
PLUMB_TAU = 0.5  # [s]
PLUMB_GATE = 0.3  # [m/s^2] of the plumb line's length about gravity
PLUMB_TRUST = 0.03  # [rad]
AXIS_LAG = 1.5e-4  # [rad] by which the heading trails a mark's axis: a gyroscope's bias over the gain, turns
AXIS_MEAN = 0.1  # [1] what the mean over the half second that the loop takes leaves of one picture's variance
COAST_TAU = 0.1  # [s] without an inertial sample the last rates are believed so long
COAST_RATE = 0.1  # [rad/s] at which it may turn then


@numba.njit(cache=True, error_model="numpy")
def _follow_rotor(a, dt):
    """Notches at the rotor's present speed; it only crawls, so they are designed anew when it has moved by 1 %."""
    # a slow rotor shakes little and its notch would delay much
    speed = max(a.rotor_speed, 0.5 * a.nominal_speed)
    if abs(speed - a.notch_speed) > 0.01 * speed:
        for h in range(HARMONICS):
            notch.design(a.notch[h], (h + 1) * speed, dt)
        a.notch_speed = speed


@numba.njit(cache=True, error_model="numpy")
def propagate(memory, t, fx, fy, fz, wx, wy, wz, tilt_e, tilt_n, variance, aid):
    """One inertial sample.

    tilt_e, tilt_n [rad]: the tilt error d as the position filter finds it, and its variance [rad^2]; `aid` [0..1]:
    how far to believe it.
    """
    a = memory[0]
    first = a.samples == 0
    dt = a.period if first else t - a.t
    a.t = t
    _follow_rotor(a, a.period)
    w0, w1, w2 = wx - a.bias[0], wy - a.bias[1], wz - a.bias[2]
    last0, last1, last2 = a.raw_rate[0], a.raw_rate[1], a.raw_rate[2]
    if first:
        a.start = t
        last0, last1, last2 = w0, w1, w2
    # force at the body origin: f - alpha x r - omega x (omega x r)
    rx, ry, rz = a.mount[0], a.mount[1], a.mount[2]
    ax, ay, az = (w0 - last0) / dt, (w1 - last1) / dt, (w2 - last2) / dt
    dot, square = w0 * rx + w1 * ry + w2 * rz, w0 * w0 + w1 * w1 + w2 * w2
    fx -= ay * rz - az * ry + w0 * dot - square * rx
    fy -= az * rx - ax * rz + w1 * dot - square * ry
    fz -= ax * ry - ay * rx + w2 * dot - square * rz
    quiet = np.empty(CHANNELS)
    for c in range(CHANNELS):
        value = fx if c == 0 else fy if c == 1 else fz if c == 2 else w0 if c == 3 else w1 if c == 4 else w2
        for h in range(HARMONICS):
            if first:
                notch.settle(a.notch[h], a.notch_memory[c, h], 0.0 if c != 2 else GRAVITY)
            value = notch.step(a.notch[h], a.notch_memory[c, h], value)
        quiet[c] = value
    for i in range(3):
        # two samples' mean has its zero at half the sampling rate, next to where the tail rotor shakes
        a.rates[i] = 0.5 * (quiet[3 + i] + (quiet[3 + i] if first else a.quiet_rate[i]))
        a.quiet_rate[i] = quiet[3 + i]
    a.raw_rate[0], a.raw_rate[1], a.raw_rate[2] = w0, w1, w2

    if a.aligned == 0:
        a.force[0] += fx
        a.force[1] += fy
        a.force[2] += fz
        align(a)
        if t - a.start >= ALIGNMENT - 0.5 * a.period:
            a.aligned = 1
            a.variance_level = a.floor_level**2 + ALIGNED**2
            remember(a)
            look_back(a)
        a.inputs[:] = 0.0
        a.plumb[0], a.plumb[1], a.plumb[2] = 0.0, 0.0, GRAVITY
        if a.aligned == 0:
            remember(a)
        return

    # mean rates of the interval by the trapezoidal rule; the force is taken into the world by the attitude of its own
    # time: the middle of its interval, less what the notches delay
    turn = np.empty(3)
    turn[0], turn[1], turn[2] = 0.5 * (w0 + last0), 0.5 * (w1 + last1), 0.5 * (w2 + last2)
    r = matrix(multiply(a.q, from_vector((0.5 * dt - notch.delay(a.notch_speed, HARMONICS)) * turn)))
    mix = min(1.0, dt / PLUMB_TAU)
    for i in range(3):
        force = r[i, 0] * quiet[0] + r[i, 1] * quiet[1] + r[i, 2] * quiet[2]
        a.plumb[i] += mix * (force - a.plumb[i])
        if i == 2:
            force -= GRAVITY
        a.mean_acceleration[i] = 0.5 * (force + a.inputs[i])
        a.inputs[i] = force
    # R f off by g d means: turned too far by (-d_n, d_e) about east and north
    length = math.sqrt(a.plumb[0] ** 2 + a.plumb[1] ** 2 + a.plumb[2] ** 2)
    still = 1.0 if abs(length - GRAVITY) < PLUMB_GATE else 0.0
    # what it shows beyond the tilt errors that are to be expected is a manoeuvre
    expected = GRAVITY * max(PLUMB_TRUST, 3.0 * math.sqrt(a.variance_level))
    shown = math.hypot(a.plumb[0], a.plumb[1])
    still *= expected / shown if shown > expected else 1.0
    gain, unaided = aid * a.gain, (1.0 - aid) * still * a.gain_unaided
    correction = np.empty(3)
    correction[0] = gain * tilt_n + unaided * a.plumb[1] / GRAVITY
    correction[1] = -gain * tilt_e - unaided * a.plumb[0] / GRAVITY
    a.inputs[3], a.inputs[4] = correction[1], -correction[0]
    measured, clear = t - a.yaw_time < MEASURED_FOR, t - a.axis_time < MEASURED_FOR
    gain_heading = a.gain_axis if clear else a.gain_heading
    correction[2] = -gain_heading * (a.axis_error if clear else a.yaw_error) if clear or measured else 0.0
    # a first error of the heading is not the gyroscope's bias
    settled = min(1.0, (AXIS_MEAN * a.axis_variance + AXIS_LAG**2) / a.variance_heading) if clear else 1.0
    # into the body
    for i in range(3):
        c = r[0, i] * correction[0] + r[1, i] * correction[1] + r[2, i] * correction[2]
        level = r[0, i] * correction[0] + r[1, i] * correction[1]
        turn[i] = dt * (turn[i] + c)
        speed = a.integral * level + 0.25 * settled * gain_heading * (c - level)
        a.bias[i] = max(-a.bias_limit, min(a.bias_limit, a.bias[i] - dt * speed))
    a.yaw_error += dt * correction[2]  # until the next azimuth
    a.axis_error += dt * correction[2]
    q = multiply(a.q, from_vector(turn))
    size = math.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    for i in range(4):
        a.q[i] = q[i] / size
    # standard deviations: the aid's; without it towards the floor as fast as the plumb line corrects, and away by the
    # bias that is not known
    learnt = 0.1 * a.gyro_std + a.gyro_std * math.exp(-a.integral * (t - a.start))
    std = math.sqrt(a.variance_level)
    alone = 2.0 * unaided * (a.floor_level**2 - a.variance_level) + 2.0 * std * learnt
    a.variance_level = aid * variance + (1.0 - aid) * (a.variance_level + dt * alone)
    std = math.sqrt(a.variance_heading)
    if clear or measured:
        floor = AXIS_MEAN * a.axis_variance + AXIS_LAG**2
        floor = floor if clear else min(a.floor_heading**2, a.variance_deviation) + 0.0015**2
        a.variance_heading += dt * 2.0 * gain_heading * (floor - a.variance_heading)
    else:
        a.variance_heading += dt * 2.0 * std * learnt
    a.variance_heading = min(a.variance_heading, math.pi**2)
    remember(a)


@numba.njit(cache=True, error_model="numpy")
def coast(memory, t):
    """On to `t` without an inertial sample: the turning dies away, the acceleration is anything about none."""
    a = memory[0]
    dt = t - a.t
    a.t = t
    for i in range(3):
        a.raw_rate[i] *= math.exp(-dt / COAST_TAU)
        a.rates[i] = a.quiet_rate[i] = a.raw_rate[i]
        a.mean_acceleration[i] = 0.0
    a.inputs[:] = 0.0
    a.q[:] = multiply(a.q, from_vector(dt * a.raw_rate))
    turned = COAST_RATE * dt
    a.variance_level += turned * (turned + 2.0 * math.sqrt(a.variance_level))
    a.variance_heading += turned * (turned + 2.0 * math.sqrt(a.variance_heading))
    remember(a)


@dataclass(frozen=True)
class AttitudeGains:
    """How fast the slow sensors turn the estimate."""

    level: float = 0.5  # [1/s] with the position filter's aid
    integral: float = 0.05  # [1/s] of the levelling, to the gyroscopes' bias
    level_unaided: float = 0.07  # [1/s] by the plumb line: manoeuvres must average out
    heading: float = 0.4  # [1/s]
    axis: float = 2.0  # [1/s] heading by a mark's axis


class AttitudeFilter:
    """The filter with its memory; `memory` goes to the compiled functions above."""

    def __init__(self, equipment: Equipment, gains: AttitudeGains = AttitudeGains()) -> None:
        """Waits for the first samples; the mean of 0.2 s gives the attitude to start from."""
        imu = equipment.sensors["imu"]
        self.memory = np.zeros(1, ATTITUDE)
        a = self.memory[0]
        a["q"] = [1.0, 0.0, 0.0, 0.0]
        a["plumb"] = [0.0, 0.0, GRAVITY]
        a["period"] = 1.0 / imu.rate
        a["mount"] = imu.position
        a["earth_field"] = equipment.magnetic_field
        a["nominal_speed"] = a["rotor_speed"] = equipment.nominal_rotor_speed
        a["gain"], a["gain_heading"], a["gain_unaided"] = gains.level, gains.heading, gains.level_unaided
        a["integral"], a["gain_axis"] = gains.integral, gains.axis
        accelerometer = math.hypot(imu["accel_bias_std"], imu["accel_drift_std"], GRAVITY * imu["misalignment_std"])
        a["gyro_std"] = math.hypot(imu["gyro_bias_std"], imu["gyro_drift_std"])
        a["bias_limit"] = 5.0 * a["gyro_std"]
        a["floor_level"] = math.hypot(accelerometer / GRAVITY, 0.0015)
        a["variance_level"] = a["floor_level"] ** 2 + ALIGNED**2
        a["variance_heading"] = math.pi**2
        a["floor_heading"], a["field_noise"] = math.radians(3.0), math.radians(1.0)
        if "mag" in equipment.sensors:
            mag = equipment.sensors["mag"]
            horizontal = float(np.hypot(*equipment.magnetic_field[:2]))
            left = math.hypot(mag["bias_std"], mag["drift_std"]) / horizontal
            # the dip turns a tilt error into an azimuth error
            dip = abs(float(equipment.magnetic_field[2])) / horizontal * float(a["floor_level"])
            a["floor_heading"] = math.hypot(left, mag["misalignment_std"], dip)
            a["field_noise"] = math.hypot(mag["noise"] / horizontal, 0.002)
        a["variance_deviation"] = a["floor_heading"] ** 2
        a["yaw_time"] = a["axis_time"] = a["deviation_time"] = -math.inf

    @property
    def quaternion(self) -> Floats:
        """(4,) wxyz, body to world."""
        return self.memory["q"][0].copy()  # type: ignore[no-any-return]

    def at(self, t: float) -> Floats:
        """(4,) wxyz at a time of the last two seconds [s]."""
        return attitude_at(self.memory, t)[0]  # type: ignore[no-any-return]
