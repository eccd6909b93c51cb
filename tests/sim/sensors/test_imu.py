"""Accelerometers and gyroscopes against closed forms and their declared statistics."""

import math

import numpy as np
import pytest

from flightlog.constants import GRAVITY
from flightlog.rotations import from_vector, matrix

RATE = 250.0


def table(samples):
    return np.array(list(samples))[:, 1:]


def test_at_rest_it_feels_gravity_upward(bench):
    (sample,) = bench.rest(bench.build("imu", perfect=True), 1)
    np.testing.assert_allclose(sample[1:], [0, 0, GRAVITY, 0, 0, 0], atol=1e-12)


@pytest.mark.parametrize("rate", [0.5, -2.0])
def test_lever_arm_in_a_pirouette(bench, rate):
    # turning about z with w at the distance r: centripetal w^2 r towards the axis; nothing along the track
    mount = (0.4, -0.3, 0.1)
    imu = bench.build("imu", perfect=True, position=mount)
    (sample,) = bench.rest(imu, 1, rates=(0.0, 0.0, rate))
    np.testing.assert_allclose(sample[1:4], [-(rate**2) * 0.4, rate**2 * 0.3, GRAVITY], atol=1e-12)


def test_lever_arm_of_an_angular_acceleration(bench):
    # alpha x r, by the derivative of a rotation: the mount's second derivative by differences
    mount, rates, acceleration = np.array([0.3, 0.2, -0.1]), np.array([0.3, -0.5, 0.8]), np.array([2.0, -1.0, 4.0])
    imu = bench.build("imu", perfect=True, position=mount)
    (sample,) = bench.rest(imu, 1, rates=rates, angular_acceleration=acceleration, specific_force=np.zeros(3))

    def place(t):  # rotation vector w t + a t^2 / 2 has rates w + a t up to the second order in t
        return matrix(from_vector(rates * t + 0.5 * acceleration * t * t)) @ mount

    h = 1e-3
    second = (place(h) - 2 * place(0.0) + place(-h)) / h**2
    np.testing.assert_allclose(sample[1:4], second, atol=2e-5)


def test_bias_scale_and_misalignment_over_flights(bench):
    # at rest, turning about z: bias shows on x, y of the force; scale and turn on what gravity and the rate do
    n = bench.numbers("imu")
    quiet = {"gyro_drift_std": 0.0, "accel_drift_std": 0.0}
    flights = np.array([
        table(bench.rest(bench.build("imu", seed, perfect=True, accel_bias_std=n["accel_bias_std"],
                                     gyro_bias_std=n["gyro_bias_std"], **quiet), 1))[0]
        for seed in range(600)
    ])  # fmt: skip
    std = flights.std(axis=0)
    # 5 % is 1.7 standard deviations of the estimate from 600 draws; 12 % is 4
    np.testing.assert_allclose(std[:3], n["accel_bias_std"], rtol=0.12)
    np.testing.assert_allclose(std[3:], n["gyro_bias_std"], rtol=0.12)
    assert np.all(np.abs(flights.mean(axis=0) - [0, 0, GRAVITY, 0, 0, 0]) < 4 * std / math.sqrt(600))

    scaled = np.array([
        table(bench.rest(bench.build("imu", seed, perfect=True, accel_scale_std=n["accel_scale_std"],
                                     misalignment_std=n["misalignment_std"]), 1))[0]
        for seed in range(600)
    ])  # fmt: skip
    # gravity along z: the scale shows on z, a turn about x or y on y and x
    assert scaled[:, 2].std() == pytest.approx(GRAVITY * n["accel_scale_std"], rel=0.12)
    np.testing.assert_allclose(scaled[:, :2].std(axis=0), GRAVITY * n["misalignment_std"], rtol=0.12)


def test_a_fixed_turn_of_the_case_turns_what_is_measured(bench):
    # the case turned by +a about y (x towards -z): gravity's reaction, up, now lies along case z and -x
    angle = 0.1
    (sample,) = bench.rest(bench.build("imu", perfect=True, misalignment_y=angle), 1)
    np.testing.assert_allclose(sample[1:4], GRAVITY * np.array([-math.sin(angle), 0, math.cos(angle)]), atol=1e-12)


def test_white_noise_has_the_declared_density(bench):
    n = bench.numbers("imu")
    imu = bench.build("imu", 1, perfect=True, accel_noise=n["accel_noise"], gyro_noise=n["gyro_noise"])
    x = table(bench.rest(imu, 20_000))
    # one-sided density N over half the sampling rate; the estimate's own deviation is 0.5 %
    np.testing.assert_allclose(x[:, :3].std(axis=0), n["accel_noise"] * math.sqrt(RATE / 2), rtol=0.03)
    np.testing.assert_allclose(x[:, 3:].std(axis=0), n["gyro_noise"] * math.sqrt(RATE / 2), rtol=0.03)
    lag_one = np.mean((x[1:] - x.mean(0)) * (x[:-1] - x.mean(0)), axis=0) / x.var(axis=0)
    assert np.all(np.abs(lag_one) < 4 / math.sqrt(len(x)))


def test_drift_is_a_gauss_markov_process(bench):
    # a short time constant so that one run holds many of them
    tau, std = 0.048, 0.01
    imu = bench.build("imu", 2, perfect=True, gyro_drift_std=std, gyro_drift_tau=tau)
    x = table(bench.rest(imu, 50_000))[:, 3:]
    x = x[500:]
    np.testing.assert_allclose(x.std(axis=0), std, rtol=0.06)
    lag = round(tau * RATE)
    correlation = np.mean(x[lag:] * x[:-lag], axis=0) / np.mean(x**2, axis=0)
    np.testing.assert_allclose(correlation, math.exp(-1), atol=0.08)


def test_drift_starts_at_zero(bench):
    starts = [
        table(bench.rest(bench.build("imu", seed, perfect=True, accel_drift_std=1.0), 1))[0, 0] for seed in range(50)
    ]
    # one step of a process of 300 s
    assert np.std(starts) < 3 * math.sqrt(2 / 300 / RATE)


def peaks(x, count):
    """Frequencies [Hz] and amplitudes of the `count` largest lines, from a Hann-windowed spectrum."""
    window = np.hanning(len(x))
    spectrum = np.abs(np.fft.rfft((x - x.mean()) * window)) * 2 / window.sum()
    found = []
    for _ in range(count):
        k = int(np.argmax(spectrum))
        found.append((k * RATE / len(x), spectrum[k]))
        spectrum[max(0, k - 8) : k + 9] = 0.0
    return sorted(found)


def test_vibration_stands_at_the_rotors_frequencies(bench):
    amplitudes = {"vibration_force_1": 0.8, "vibration_force_2": 1.5, "vibration_force_tail": 0.5}
    imu = bench.build("imu", 0, perfect=True, **amplitudes)
    speed = 2 * math.pi * 25.0
    x = table(bench.rest(imu, 5000, rotor_speed=speed))[:, 0]
    # 115 Hz is the tail rotor's, 4.6 times 25 Hz
    (f1, a1), (f2, a2), (f3, a3) = peaks(x, 3)
    assert (f1, f2, f3) == (pytest.approx(25, abs=0.05), pytest.approx(50, abs=0.05), pytest.approx(115, abs=0.05))
    share = (speed / bench.site.nominal_rotor_speed) ** 2
    assert (a1, a2, a3) == (
        pytest.approx(0.8 * share, rel=0.02),
        pytest.approx(0.75 * share, rel=0.02),
        pytest.approx(0.5 * share, rel=0.02),
    )


def test_what_lies_above_half_the_sampling_rate_is_aliased(bench):
    imu = bench.build("imu", 0, perfect=True, vibration_force_tail=1.0, tail_ratio=7.0)
    ((frequency, amplitude),) = peaks(table(bench.rest(imu, 5000, rotor_speed=2 * math.pi * 25.0))[:, 0], 1)
    assert frequency == pytest.approx(250 - 175, abs=0.05)
    assert amplitude == pytest.approx(1.0, rel=0.02)


def test_vibration_follows_the_square_and_the_phase_of_a_slowing_rotor(bench, truth):
    imu = bench.build("imu", 0, perfect=True, vibration_force_1=1.0)
    nominal, slope = bench.site.nominal_rotor_speed, -20.0

    def slowing(t):
        return truth(t, rotor_speed=nominal + slope * t)

    x = table(bench.run(imu, 1000, slowing))
    t = np.arange(1000) / RATE
    speed = nominal + slope * t
    radius = np.hypot(x[:, 0], x[:, 1])
    np.testing.assert_allclose(radius, (speed / nominal) ** 2, rtol=1e-9)
    phase = np.unwrap(np.arctan2(x[:, 1], x[:, 0]))
    # the trapezoid is exact for a speed that changes linearly
    np.testing.assert_allclose(phase - phase[0], nominal * t + 0.5 * slope * t**2, atol=1e-6)


def test_it_is_clipped_at_its_range(bench):
    imu = bench.build("imu", perfect=True, position=(0, 0, 0))
    (sample,) = bench.rest(imu, 1, specific_force=(1e4, -1e4, 0.0), rates=(1e3, -1e3, 0.0))
    n = bench.numbers("imu")
    assert sample.fx == n["accel_range"]
    assert sample.fy == -n["accel_range"]
    assert sample.wx == n["gyro_range"]
    assert sample.wy == -n["gyro_range"]
