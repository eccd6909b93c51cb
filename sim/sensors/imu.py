"""Strapdown accelerometers and gyroscopes, with the rotor's vibration.

measured = scale * misaligned(true at the mount + vibration) + turn-on bias + drift + white noise, clipped at the range.
The vibration is locked to the rotor's phase, which is integrated from sample to sample; what lies above half the
sampling rate is aliased, as in a device without an analogue filter.
"""

import math
from collections.abc import Mapping
from typing import ClassVar

import numba
import numpy as np

from flightlog.rotations import from_vector, matrix
from flightlog.signals import ImuSample
from sim.parameters import Parameter
from sim.sensors.contract import Floats, Site, Truth
from sim.sensors.device import CLOCK, LATENCY, RATE, Device, Numbers

AXES = ("fx", "fy", "fz", "wx", "wy", "wz")
UNITS = {"f": "m/s^2", "w": "rad/s"}

_ROWS = 256  # noise drawn at a time


@numba.njit(cache=True)
def _measure(force, rates, acceleration, speed, dt, position, p, calibration, x, noise, row):
    """(fx, fy, fz, wx, wy, wz) measured.

    x: drift (6), rotor phase, rotor speed at the last sample, in place. p: white std, drift decay and drift step of
    the force, the same of the rates, ranges of both, six vibration amplitudes, tail ratio, nominal rotor speed.
    calibration (6, 4): rows of the scaled and misaligned axes, bias in the last column. noise (N, 12) standard normal.
    """
    # phase by the trapezoidal rule; each angle is kept small for the sine's sake
    x[6] = (x[6] + 0.5 * (x[7] + speed) * dt) % (2.0 * math.pi)
    x[8] = (x[8] + 0.5 * p[14] * (x[7] + speed) * dt) % (2.0 * math.pi)
    x[7] = speed
    share = (speed / p[15]) ** 2
    s1, c1 = share * math.sin(x[6]), share * math.cos(x[6])
    s2, c2 = share * math.sin(2.0 * x[6]), share * math.cos(2.0 * x[6])
    st, ct = share * math.sin(x[8]), share * math.cos(x[8])
    wx, wy, wz = rates[0], rates[1], rates[2]
    ax, ay, az = acceleration[0], acceleration[1], acceleration[2]
    rx, ry, rz = position[0], position[1], position[2]
    # f at the mount = f + alpha x r + omega x (omega x r)
    dot = wx * rx + wy * ry + wz * rz
    square = wx * wx + wy * wy + wz * wz
    # an imbalance of the main rotor turns in its plane; two blades shake the mast up and down twice a turn, and in
    # the plane half as much; the tail rotor's imbalance turns in the plane of symmetry
    fx = force[0] + ay * rz - az * ry + wx * dot - square * rx + p[8] * c1 + 0.5 * p[9] * c2 + p[10] * ct
    fy = force[1] + az * rx - ax * rz + wy * dot - square * ry + p[8] * s1 + 0.5 * p[9] * s2
    fz = force[2] + ax * ry - ay * rx + wz * dot - square * rz + p[9] * c2 + p[10] * st
    wx += p[11] * s1 + 0.5 * p[12] * s2
    wy += -p[11] * c1 + p[12] * c2
    wz += p[13] * ct
    out = np.empty(6)
    for i in range(6):
        a, b, c = (fx, fy, fz) if i < 3 else (wx, wy, wz)
        white, decay, step, limit = (p[0], p[1], p[2], p[6]) if i < 3 else (p[3], p[4], p[5], p[7])
        x[i] = decay * x[i] + step * noise[row, i]
        value = calibration[i, 0] * a + calibration[i, 1] * b + calibration[i, 2] * c + calibration[i, 3]
        value += x[i] + white * noise[row, 6 + i]
        out[i] = min(limit, max(-limit, value))
    return out[0], out[1], out[2], out[3], out[4], out[5]


def _fixed(prefix: str, unit: Mapping[str, str], default: float, low: float, high: float, what: str) -> list[Parameter]:
    return [Parameter(f"{prefix}_{axis}", unit[axis[0]], low, high, f"{what} of {axis}", default) for axis in AXES]


class Imu(Device):
    """Specific force and angular rate in body axes at the mount."""

    topic: ClassVar[str] = "imu"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        RATE,
        LATENCY,
        CLOCK,
        Parameter("accel_noise", "m/s^2/sqrt(Hz)", 0.0, 0.1, "white noise density of the force, one-sided"),
        Parameter("gyro_noise", "rad/s/sqrt(Hz)", 0.0, 0.01, "white noise density of the rate, one-sided"),
        Parameter("accel_bias_std", "m/s^2", 0.0, 2.0, "turn-on bias left by the calibration, per flight and axis"),
        Parameter("gyro_bias_std", "rad/s", 0.0, 0.1, "turn-on bias left by the pad calibration, per flight and axis"),
        Parameter("accel_drift_std", "m/s^2", 0.0, 1.0, "Gauss-Markov drift of the force's bias, zero at the start"),
        Parameter("accel_drift_tau", "s", 1.0, 1e5, "its time constant"),
        Parameter("gyro_drift_std", "rad/s", 0.0, 0.1, "Gauss-Markov drift of the rate's bias, zero at the start"),
        Parameter("gyro_drift_tau", "s", 1.0, 1e5, "its time constant"),
        Parameter("accel_scale_std", "1", 0.0, 0.1, "scale error, drawn per flight and axis"),
        Parameter("gyro_scale_std", "1", 0.0, 0.1, "scale error, drawn per flight and axis"),
        Parameter("misalignment_std", "rad", 0.0, 0.2, "turn of the case against the body, drawn per flight and axis"),
        Parameter("vibration_force_1", "m/s^2", 0.0, 50.0, "amplitude once a turn of the main rotor, nominal speed"),
        Parameter("vibration_force_2", "m/s^2", 0.0, 50.0, "amplitude twice a turn"),
        Parameter("vibration_force_tail", "m/s^2", 0.0, 50.0, "amplitude once a turn of the tail rotor"),
        Parameter("vibration_rate_1", "rad/s", 0.0, 2.0, "amplitude once a turn of the main rotor, nominal speed"),
        Parameter("vibration_rate_2", "rad/s", 0.0, 2.0, "amplitude twice a turn"),
        Parameter("vibration_rate_tail", "rad/s", 0.0, 2.0, "amplitude once a turn of the tail rotor"),
        Parameter("tail_ratio", "1", 1.0, 10.0, "turns of the tail rotor for one of the main rotor"),
        Parameter("accel_range", "m/s^2", 10.0, 1000.0, "the force is clipped at this value"),
        Parameter("gyro_range", "rad/s", 1.0, 100.0, "the rate is clipped at this value"),
        *_fixed("bias", UNITS, 0.0, -5.0, 5.0, "fixed bias"),
        *_fixed("scale", {"f": "1", "w": "1"}, 1.0, 0.5, 2.0, "fixed scale, measured over true,"),
        Parameter("misalignment_x", "rad", -0.5, 0.5, "fixed turn of the case about the body's x", 0.0),
        Parameter("misalignment_y", "rad", -0.5, 0.5, "fixed turn of the case about the body's y", 0.0),
        Parameter("misalignment_z", "rad", -0.5, 0.5, "fixed turn of the case about the body's z", 0.0),
    )
    ERRORS: ClassVar[tuple[tuple[str, str], ...]] = tuple((f"bias_{axis}", UNITS[axis[0]]) for axis in AXES)

    def __init__(self, numbers: Mapping[str, float], position: Floats, site: Site, rng: np.random.Generator) -> None:
        """Draws turn-on bias, scale and misalignment of the flight, and where the rotor stands."""
        super().__init__(numbers, position, site, rng)
        self._mount: Floats = np.array(self.position)
        self._draws: Floats = rng.standard_normal(15)  # bias (6), scale (6), misalignment (3), in standard deviations
        phase, tail_phase = rng.uniform(0.0, 2.0 * np.pi, 2)
        self._state: Floats = np.array([0.0] * 6 + [phase, site.nominal_rotor_speed, tail_phase])
        self._noise: Floats = np.empty((_ROWS, 12))
        self._row = _ROWS
        self._calibrate()

    def _calibrate(self) -> None:
        """Whatever follows from `numbers` alone; done again when one was changed."""
        n = self.numbers
        bandwidth = 0.5 * n["rate"]
        packed: list[float] = []
        for kind in ("accel", "gyro"):
            decay = math.exp(-self._period / n[f"{kind}_drift_tau"])
            step = n[f"{kind}_drift_std"] * math.sqrt(1.0 - decay * decay)
            packed += [n[f"{kind}_noise"] * math.sqrt(bandwidth), decay, step]
        packed += [n["accel_range"], n["gyro_range"]]
        packed += [n[f"vibration_{kind}_{of}"] for kind in ("force", "rate") for of in ("1", "2", "tail")]
        self._packed: Floats = np.array([*packed, n["tail_ratio"], self.site.nominal_rotor_speed])
        kinds = np.repeat([0, 1], 3)
        bias_std, scale_std = (
            np.array([n[f"accel_{name}"], n[f"gyro_{name}"]])[kinds] for name in ("bias_std", "scale_std")
        )
        scale = np.array([n[f"scale_{axis}"] for axis in AXES]) + scale_std * self._draws[6:12]
        turn = np.array([n[f"misalignment_{axis}"] for axis in "xyz"]) + n["misalignment_std"] * self._draws[12:]
        case = matrix(from_vector(turn)).T  # body to case
        self._calibration: Floats = np.empty((6, 4))
        self._calibration[:, :3] = scale[:, None] * np.vstack([case, case])
        self._calibration[:, 3] = [n[f"bias_{axis}"] for axis in AXES] + bias_std * self._draws[:6]
        if isinstance(n, Numbers):
            n.changed = False

    def sample(self, truth: Truth) -> ImuSample:
        """Specific force [m/s^2] and rate [rad/s] at `truth`."""
        if self.numbers.changed:  # type: ignore[attr-defined]
            self._calibrate()
        if self._row == _ROWS:
            self._noise = self.rng.standard_normal((_ROWS, 12))
            self._row = 0
        t = truth.t
        measured = _measure(
            truth.specific_force, truth.rates, truth.angular_acceleration, truth.rotor_speed, self.elapsed(t),
            self._mount, self._packed, self._calibration, self._state, self._noise, self._row,
        )  # fmt: skip
        self._row += 1
        return ImuSample(t, *measured)

    def errors(self) -> tuple[float, ...]:
        """Bias of each axis: fixed, drawn and drifted."""
        return tuple((self._calibration[:, 3] + self._state[:6]).tolist())
