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
from flightlog.constants import GRAVITY
from flightlog.equipment import Equipment
from flightlog.rotations import angles, from_vector, matrix, multiply, quaternion, wrap

Floats = NDArray[np.float64]

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
        ("deviation", "f8"),  # [rad] azimuth by magnetometer minus true, counter-clockwise
        ("variance_deviation", "f8"),  # [rad^2]
        ("deviation_time", "f8"),  # [s]
        ("rotor_speed", "f8"),  # [rad/s]
        ("notch_speed", "f8"),  # [rad/s] for which the notches stand
        ("notch", "f8", (HARMONICS, 5)),
        ("notch_memory", "f8", (CHANNELS, HARMONICS, 2)),
        ("times", "f8", (HISTORY,)),
        ("quaternions", "f8", (HISTORY, 4)),
        ("turning", "f8", (HISTORY, 3)),  # [rad/s] rates of that time
        # settings
        ("period", "f8"),  # [s] of the inertial sensor
        ("mount", "f8", (3,)),  # [m] its place, body axes
        ("earth_field", "f8", (3,)),  # [uT] ENU
        ("nominal_speed", "f8"),  # [rad/s] of the rotor
        ("gain", "f8"),  # [1/s] proportional, level
        ("integral", "f8"),  # [1/s] share of the levelling that goes to the gyroscopes' bias
        ("gain_heading", "f8"),  # [1/s]
        ("gain_unaided", "f8"),  # [1/s] level, by the plumb line
        ("bias_limit", "f8"),  # [rad/s]
        ("floor_level", "f8"),  # [rad] what b/g and misalignment leave
        ("floor_heading", "f8"),  # [rad] of the magnetometer alone
        ("field_noise", "f8"),  # [rad] of one magnetometer sample's azimuth
        ("gyro_std", "f8"),  # [rad/s] unknown bias
    ],
    align=True,
)

ALIGNMENT = 0.2  # [s] five turns of the rotor: the vibration averages out
ALIGNED = 0.012  # [rad] tilt error that is left: trimmed flight is not quite without acceleration
PLUMB_TAU = 0.5  # [s]
PLUMB_GATE = 0.3  # [m/s^2] of the plumb line's length about gravity
DEVIATION_TAU = 60.0  # [s] the magnetometer's deviation changes in: drift, and turns of the nose
PLUMB_TRUST = 0.03  # [rad]
COAST_TAU = 0.1  # [s] without an inertial sample the last rates are believed so long
COAST_RATE = 0.1  # [rad/s] at which it may turn then
MEASURED_FOR = 0.2  # [s] an azimuth stays in force until the next one


@numba.njit(cache=True, error_model="numpy")
def _align(a):
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
def _remember(a):
    i = a.samples % HISTORY
    a.times[i] = a.t
    a.quaternions[i, :] = a.q
    a.turning[i, :] = a.raw_rate
    a.samples += 1


@numba.njit(cache=True, error_model="numpy")
def _look_back(a):
    """Carry the attitude found back over the samples from which it was found."""
    for k in range(a.samples - 2, max(0, a.samples - HISTORY) - 1, -1):
        i, j = k % HISTORY, (k + 1) % HISTORY
        dt = a.times[j] - a.times[i]
        a.quaternions[i, :] = multiply(a.quaternions[j], from_vector(-0.5 * dt * (a.turning[i] + a.turning[j])))


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
        _align(a)
        if t - a.start >= ALIGNMENT - 0.5 * a.period:
            a.aligned = 1
            a.variance_level = a.floor_level**2 + ALIGNED**2
            _remember(a)
            _look_back(a)
        a.inputs[:] = 0.0
        a.plumb[0], a.plumb[1], a.plumb[2] = 0.0, 0.0, GRAVITY
        if a.aligned == 0:
            _remember(a)
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
    measured = t - a.yaw_time < MEASURED_FOR
    correction[2] = -a.gain_heading * a.yaw_error if measured else 0.0
    # into the body
    for i in range(3):
        c = r[0, i] * correction[0] + r[1, i] * correction[1] + r[2, i] * correction[2]
        level = r[0, i] * correction[0] + r[1, i] * correction[1]
        turn[i] = dt * (turn[i] + c)
        speed = a.integral * level + 0.25 * a.gain_heading * (c - level)
        a.bias[i] = max(-a.bias_limit, min(a.bias_limit, a.bias[i] - dt * speed))
    a.yaw_error += dt * correction[2]  # until the next azimuth
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
    if measured:
        floor = min(a.floor_heading**2, a.variance_deviation) + 0.0025**2
        a.variance_heading += dt * 2.0 * a.gain_heading * (floor - a.variance_heading)
    else:
        a.variance_heading += dt * 2.0 * std * learnt
    a.variance_heading = min(a.variance_heading, math.pi**2)
    _remember(a)


@numba.njit(cache=True, error_model="numpy")
def coast(memory, t):
    """On to `t` without an inertial sample: the turning dies away, the acceleration is anything about none."""
    a = memory[0]
    dt = t - a.t
    a.t = t
    for i in range(3):
        a.raw_rate[i] *= math.exp(-dt / COAST_TAU)
        a.rates[i] = a.raw_rate[i]
        a.mean_acceleration[i] = 0.0
    a.inputs[:] = 0.0
    a.q[:] = multiply(a.q, from_vector(dt * a.raw_rate))
    turned = COAST_RATE * dt
    a.variance_level += turned * (turned + 2.0 * math.sqrt(a.variance_level))
    a.variance_heading += turned * (turned + 2.0 * math.sqrt(a.variance_heading))
    _remember(a)


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
            _align(a)
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


@numba.njit(cache=True, error_model="numpy")
def correct_axis(memory, t, angle, std):
    """The mark's axis, which points north, seen `angle` [rad] clockwise from forward at the time `t`."""
    a = memory[0]
    q, _ = attitude_at(memory, t)
    _, _, heading = angles(q)
    # the heading is -angle modulo pi; yaw runs against it
    error = -angle - heading
    error -= math.pi * math.floor(error / math.pi + 0.5)
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


@dataclass(frozen=True)
class AttitudeGains:
    """How fast the slow sensors turn the estimate."""

    level: float = 0.5  # [1/s] with the position filter's aid
    integral: float = 0.05  # [1/s] of the levelling, to the gyroscopes' bias
    level_unaided: float = 0.07  # [1/s] by the plumb line: manoeuvres must average out
    heading: float = 0.4  # [1/s]


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
        a["integral"] = gains.integral
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
        a["yaw_time"] = a["deviation_time"] = -math.inf

    @property
    def quaternion(self) -> Floats:
        """(4,) wxyz, body to world."""
        return self.memory["q"][0].copy()  # type: ignore[no-any-return]

    def at(self, t: float) -> Floats:
        """(4,) wxyz at a time of the last two seconds [s]."""
        return attitude_at(self.memory, t)[0]  # type: ignore[no-any-return]
