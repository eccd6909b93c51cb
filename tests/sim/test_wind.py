import math

import numba
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import welch
from scipy.stats import gamma

from sim.weather import Weather
from sim.wind import Gust, Wind, dryden
from sim.wind.mean import FOOT, mean_speed

MINUTES = 200_000.0  # [s]


@numba.njit(cache=True)
def generate(seed, steps, height, speed, airspeed, dt):
    """The generator alone: (steps, 3) turbulence."""
    np.random.seed(seed)  # noqa: NPY002 (numba's own generator)
    x, normals, out = np.zeros(5), np.zeros(5), np.empty((steps, 3))
    for i in range(5):
        normals[i] = np.random.standard_normal()  # noqa: NPY002
    dryden.start(x, normals)
    for k in range(steps):
        for i in range(5):
            normals[i] = np.random.standard_normal()  # noqa: NPY002
        out[k] = dryden.step(x, normals, height, speed, airspeed, dt)
    return out


def specification(height, speed):
    """Sigma (3,) [m/s] and L (3,) [m] by MIL-F-8785C, in feet, written independently of the code."""
    h = height / 0.3048
    w20 = speed * math.log(20.0 / 0.15) / math.log(10.0 / 0.3048 / 0.15)
    sigma_w = 0.1 * w20
    factor = 0.177 + 0.000823 * h
    return (
        np.array([sigma_w / factor**0.4, sigma_w / factor**0.4, sigma_w]),
        np.array([h / factor**1.2, h / factor**1.2, h]) * 0.3048,
    )


def psd(axis, f, sigma, length, airspeed):
    """One-sided spectrum [m^2/s^2/Hz] of the Dryden form."""
    tau = length / airspeed
    a = (2.0 * np.pi * f * tau) ** 2
    if axis == 0:
        return 4.0 * sigma**2 * tau / (1.0 + a)
    return 2.0 * sigma**2 * tau * (1.0 + 3.0 * a) / (1.0 + a) ** 2


def test_anchors_of_the_specification():
    sigma, length = specification(10.0, 1.5)
    assert length[0] == pytest.approx(67.0, abs=1.0)
    assert sigma[0] / sigma[2] == pytest.approx(1.89, abs=0.01)


@pytest.mark.parametrize("height", [1.0, 10.0, 30.0, 200.0])
def test_scales_and_intensities_are_the_specifications(height):
    sigma, length = specification(max(height, 10.0 * FOOT), 7.0)
    assert dryden.intensities(height, 7.0) == pytest.approx((sigma[0], sigma[2]))
    assert dryden.lengths(height) == pytest.approx((length[0], length[2]))


@pytest.mark.parametrize("speed", [1.5, 5.0, 15.0])
def test_standard_deviations_and_spectrum_over_200000_seconds(speed):
    height, dt = 10.0, 0.1
    sigma, length = specification(height, speed)
    air = generate(3, int(MINUTES / dt), height, speed, speed, dt)
    ratio = air.std(axis=0) / sigma
    print(f"{speed:g} m/s: std over specification {np.round(ratio, 3)}")
    np.testing.assert_allclose(ratio, 1.0, atol=0.05)

    f, power = welch(air, fs=1.0 / dt, nperseg=2**15, axis=0)
    for axis in range(3):
        # octaves known to a few percent (a bandwidth of 900 periods of the record), an octave under the folding
        low, checked = 900.0 / MINUTES, 0
        while 2.0 * low <= 0.1 / dt:
            band = (f >= low) & (f < 2.0 * low)
            wanted = psd(axis, f[band], sigma[axis], length[axis], speed).sum()
            assert power[band, axis].sum() / wanted == pytest.approx(1.0, abs=0.10), (axis, low)
            low, checked = 2.0 * low, checked + 1
        assert checked >= 7


@pytest.mark.parametrize("dt", [0.002, 0.05, 2.0, 30.0])
def test_the_tick_does_not_matter(dt):
    sigma, _ = specification(10.0, 5.0)
    steps = 2_000_000
    std = generate(4, steps, 10.0, 5.0, 5.0, dt).std(axis=0)
    effective = min(steps * dt / 27.0, steps)  # 27 s: twice L/V of the slowest axis
    np.testing.assert_allclose(std / sigma, 1.0, atol=4.0 / math.sqrt(2.0 * effective) + 0.003)


@pytest.mark.parametrize("d", [1e-6, 3e-4, 0.999e-3, 1.001e-3, 0.05, 1.0, 8.0])
def test_one_step_is_the_matrix_exponential(d):
    drift = np.array([[-1.0, 0.0], [1.0, -1.0]])
    # Van Loan 1978: transition and noise covariance of one step from one exponential
    block = expm(np.block([[-drift, np.diag([1.0, 0.0])], [np.zeros((2, 2)), drift.T]]) * d)
    transition, noise = block[2:, 2:].T, block[2:, 2:].T @ block[:2, 2:]
    decay, l11, l21, l22 = dryden.noise_roots(d)
    np.testing.assert_allclose(decay * np.array([[1.0, 0.0], [d, 1.0]]), transition, rtol=1e-9, atol=1e-12)
    root = np.array([[l11, 0.0], [l21, l22]])
    np.testing.assert_allclose(root @ root.T, noise, rtol=2e-6, atol=1e-30)


def test_two_steps_are_one_of_twice_the_length():
    def covariance(d):
        decay, l11, l21, l22 = dryden.noise_roots(d)
        root = np.array([[l11, 0.0], [l21, l22]])
        return decay * np.array([[1.0, 0.0], [d, 1.0]]), root @ root.T

    (phi, noise), (phi2, noise2) = covariance(0.02), covariance(0.04)
    np.testing.assert_allclose(phi @ phi, phi2, rtol=1e-12)
    np.testing.assert_allclose(phi @ noise @ phi.T + noise, noise2, rtol=1e-9)


def test_runs_of_900_seconds_lie_in_their_own_band():
    """A flight is short: its standard deviation scatters. 95 % of all runs lie where theory says."""
    speed, dt, length_run = 5.0, 0.1, 900.0
    sigma, length = specification(10.0, speed)
    air = generate(5, int(MINUTES / dt), 10.0, speed, speed, dt)
    each = int(length_run / dt)
    runs = air[: len(air) // each * each].reshape(-1, each, 3)
    lag = np.arange(0.0, length_run, dt)
    for axis in range(3):
        tau = length[axis] / speed
        correlation = np.exp(-lag / tau) * (1.0 if axis == 0 else 1.0 - lag / (2.0 * tau))
        scatter = 4.0 / length_run * np.sum((1.0 - lag / length_run) * correlation**2) * dt
        band = np.sqrt(gamma.ppf((0.025, 0.975), 1.0 / scatter, scale=scatter))  # of a sum of squares, about zero
        std = np.sqrt(np.mean(runs[:, :, axis] ** 2, axis=1)) / sigma[axis]
        print(f"{'uvw'[axis]}: first run {std[0]:.2f} of the specification, 95 % band {band.round(2)}")
        assert 0.90 <= np.mean((std > band[0]) & (std < band[1])) <= 0.99


def test_no_wind_no_turbulence_and_turbulence_can_be_switched_off():
    still = Wind(Weather(wind=0.0), np.random.default_rng(1))
    off = Wind(Weather(wind=5.0, turbulence="none"), np.random.default_rng(1))
    for k in range(100):
        np.testing.assert_array_equal(still.step(10.0, 0.0, 0.004, 0.004 * k), 0.0)
        np.testing.assert_allclose(off.step(7.0, 5.0, 0.004, 0.004 * k), off.mean(7.0))


def test_hover_in_wind_is_turbulent_and_flight_against_it_more_quickly_so():
    def zero_crossings(airspeed):
        wind = Wind(Weather(wind=5.0, wind_from=0.0), np.random.default_rng(1))
        north = np.array([wind.step(10.0, airspeed, 0.01, 0.01 * k)[2] for k in range(20_000)])
        return np.count_nonzero(np.diff(np.sign(north)))

    assert zero_crossings(5.0) > 20
    assert zero_crossings(15.0) > 1.4 * zero_crossings(5.0)


def test_the_mean_wind_has_its_profile():
    assert mean_speed(10.0, 4.0) == pytest.approx(4.0)
    assert mean_speed(20.0 * FOOT, 4.0) == pytest.approx(4.0 * math.log(20 / 0.15) / math.log(10 / 0.3048 / 0.15))
    assert mean_speed(0.15 * FOOT, 4.0) == 0.0
    assert mean_speed(-1.0, 4.0) == 0.0
    assert np.all(np.diff([mean_speed(h, 4.0) for h in np.linspace(0.05, 100.0, 50)]) > 0.0)


@pytest.mark.parametrize(
    ("come_from_deg", "towards"), [(0.0, (0.0, -1.0)), (90.0, (-1.0, 0.0)), (180.0, (0.0, 1.0)), (250.0, (0.94, 0.342))]
)
def test_the_air_moves_away_from_where_the_wind_comes_from(come_from_deg, towards):
    wind = Wind(Weather(wind=2.0, wind_from=math.radians(come_from_deg), turbulence="none"), np.random.default_rng(1))
    np.testing.assert_allclose(wind.step(10.0, 2.0, 0.004, 0.0)[:2], 2.0 * np.array(towards), atol=2e-3)


def test_turbulence_lies_along_the_mean_wind():
    def steps(come_from):
        wind = Wind(Weather(wind=8.0, wind_from=come_from), np.random.default_rng(1))
        return np.array([wind.step(10.0, 8.0, 0.1, 0.1 * k).copy() for k in range(50)])

    north, east = steps(math.pi), steps(1.5 * math.pi)  # blowing north, blowing east
    np.testing.assert_allclose(east[:, 0], north[:, 1], atol=1e-12)
    np.testing.assert_allclose(east[:, 1], -north[:, 0], atol=1e-12)
    np.testing.assert_allclose(east[:, 2], north[:, 2], atol=1e-12)


def test_wind_may_change_and_gusts_may_come_in_flight():
    wind = Wind(Weather(wind=2.0, wind_from=0.0, turbulence="none"), np.random.default_rng(1))
    wind.set_mean(6.0, 0.5 * math.pi)
    np.testing.assert_allclose(wind.step(10.0, 6.0, 0.004, 1.0), (-6.0, 0.0, 0.0), atol=1e-12)
    wind.add(Gust(start=2.0, duration=4.0, speed=3.0, wind_from=0.5 * math.pi, up=-1.0))
    wind.add(Gust.of_length(start=20.0, length=30.0, airspeed=6.0, speed=2.0))
    for t, expected in (
        (2.0, (-6.0, 0.0, 0.0)), (3.0, (-7.5, 0.0, -0.5)), (4.0, (-9.0, 0.0, -1.0)), (6.0, (-6.0, 0.0, 0.0)),
        (25.0, (-6.0, -2.0, 0.0)), (22.5, (-6.0, -1.0, 0.0)), (30.1, (-6.0, 0.0, 0.0)),
    ):  # fmt: skip
        np.testing.assert_allclose(wind.step(10.0, 6.0, 0.004, t), expected, atol=1e-12)


def test_the_same_generator_gives_the_same_air():
    def fly(seed):
        wind = Wind(Weather(), np.random.default_rng(seed))
        return np.array([wind.step(10.0, 1.5, 0.004, 0.004 * k).copy() for k in range(3000)])

    np.testing.assert_array_equal(fly(7), fly(7))
    assert not np.array_equal(fly(7), fly(8))


@pytest.mark.parametrize(("name", "knots"), [("light", 15.0), ("moderate", 30.0), ("severe", 45.0)])
def test_a_class_is_as_strong_as_in_its_own_wind_whatever_blows(name, knots):
    """Standard deviations over a flight's time, against the specification at W_20 = 15, 30, 45 knots."""
    w20 = knots * 1852.0 / 3600.0
    speed = w20 / (math.log(20.0 / 0.15) / math.log(10.0 / 0.3048 / 0.15))
    sigma, _ = specification(10.0, speed)
    wind = Wind(Weather(wind=4.0, wind_from=math.radians(270.0), turbulence=name), np.random.default_rng(1))
    dt = 2.0  # far below the longest L/V of 17 s
    air = np.array([wind.step(10.0, 4.0, dt, dt * k).copy() for k in range(40_000)])
    along, left, up = (air - wind.mean(10.0)).T
    # 80,000 s hold 2,400 independent spans of 2 L/V: 1.5 % either way
    np.testing.assert_allclose([along.std(), left.std(), up.std()], sigma, rtol=0.06)


def test_a_class_keeps_its_strength_when_the_wind_changes():
    weak, strong = (Wind(Weather(wind=4.0, turbulence="moderate"), np.random.default_rng(2)) for _ in range(2))
    strong.set_mean(9.0, 0.0)
    weak.set_mean(4.0, 0.0)
    one, other = weak.step(10.0, 4.0, 0.01, 0.01) - weak.mean(10.0), strong.step(10.0, 4.0, 0.01, 0.01)
    np.testing.assert_allclose(one, other - strong.mean(10.0), atol=1e-12)
