"""The adaptive Kalman filter of Lei 2012 against filterpy, the closed form, and what it should withstand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from estimators.lei_akf import AkfReading, LeiFilter, correct, weights
from estimators.lei_sensors import BARO, GPS, HIGH, NEAR, SONAR, VISION, LeiSensors, row

STILL = AkfReading(prediction="still")


def test_rows_are_equations_16_and_18() -> None:
    np.testing.assert_array_equal([row(s, 2, 1) for s in HIGH], [[1, 1], [1, 0], [1, 0]])
    np.testing.assert_array_equal([row(s, 1, 0)[0] for s in NEAR], [1, 1, 1])


def test_within_two_deviations_it_is_the_kalman_filter() -> None:
    """Equations 19 to 26 by filterpy, whose update is the whole vector's too."""
    rng = np.random.default_rng(0)
    h, r = np.array([[1.0, 1], [1, 0], [1, 0]]), np.diag([0.092, 0.165, 0.351]) ** 2
    oracle = KalmanFilter(dim_x=2, dim_z=3)
    oracle.x, oracle.P, oracle.H, oracle.R = np.zeros((2, 1)), np.diag([4.0, 1.0]), h, r
    x, p = np.zeros(2), np.diag([4.0, 1.0])
    for _ in range(30):
        z = np.array([0.3, 0.0, 0.0]) + 0.05 * rng.uniform(-1, 1, 3)
        found = correct(x, p, z, h, r, STILL)
        oracle.update(z[:, None])
        x, p = found.x, found.p
        np.testing.assert_allclose(found.weight, 1.0)
        np.testing.assert_allclose(x, oracle.x[:, 0], atol=1e-12)
        np.testing.assert_allclose(p, oracle.P, atol=1e-12)


@pytest.mark.parametrize(
    ("gain", "ratio", "expected"),
    [("three", 1.9, 1.0), ("three", 4.0, 0.5), ("three", 5.1, 0.0), ("huber", 8.0, 0.25), ("constant", 2.1, 0.3)],
)
def test_the_branches_of_equation_27(gain: str, ratio: float, expected: float) -> None:
    reading = replace(STILL, gain=gain)  # type: ignore[arg-type]
    found = weights(np.array([0.1, ratio * 0.7]), np.array([1.0, 0.7]), reading)
    np.testing.assert_allclose(found, [1.0, expected])
    whole = weights(np.array([0.1, ratio * 0.7]), np.array([1.0, 0.7]), replace(reading, scaled="whole"))
    np.testing.assert_allclose(whole, [expected, expected])


def test_printed_equation_24_is_conservative_for_a_scalar() -> None:
    """P - n K H P as printed, P - (2 n - n^2) K H P in truth."""
    p, r, n = 4.0, 1.0, 0.3
    z = np.array([2.5 * math.sqrt(p + r)])
    reading = replace(STILL, gain="constant", n=n)
    shrink = p * p / (p + r)
    for covariance, expected in (("printed", p - n * shrink), ("joseph", p - (2 * n - n * n) * shrink)):
        found = correct(np.zeros(1), np.array([[p]]), z, np.eye(1), np.array([[r]]),
                        replace(reading, covariance=covariance))  # type: ignore[arg-type]  # fmt: skip
        assert found.p[0, 0] == pytest.approx(expected)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(-50, 50), min_size=3, max_size=3),
    st.sampled_from(["three", "huber", "constant"]), st.sampled_from(["columns", "whole"]),
    st.floats(0.01, 100), st.floats(-0.99, 0.99),
)  # fmt: skip
def test_joseph_s_covariance_stays_one(z, gain, scaled, size, correlation) -> None:
    p = size * np.array([[1.0, 0.5 * correlation], [0.5 * correlation, 0.25]])
    h = np.array([[1.0, 1], [1, 0], [1, 0]])
    found = correct(np.zeros(2), p, np.array(z), h, np.diag([0.01, 0.03, 0.12]),
                    replace(STILL, gain=gain, scaled=scaled))  # fmt: skip
    assert np.all(np.linalg.eigvalsh(found.p) >= -1e-12 * size)
    if scaled == "whole":  # P - (2n - n^2) K S K'; columns scaled each for itself are no longer the optimal gain's
        assert np.trace(found.p) <= np.trace(p) * (1 + 1e-12)
    assert np.all((found.weight >= 0) & (found.weight <= 1))


def hover(reading: AkfReading, cycles: int = 300, height: float = 10.0, seed: int = 0) -> LeiFilter:
    """Half a minute of good sensors; the barometer off by 0.5 m, no echo above the ranger's reach."""
    rng, akf = np.random.default_rng(seed), LeiFilter(reading)
    for _ in range(cycles):
        akf.hear(BARO, height + 0.5 + 0.092 * rng.standard_normal())
        akf.hear(GPS, height + 0.165 * rng.standard_normal())
        akf.hear(VISION, height + 0.351 * rng.standard_normal())
        akf.echo(height if height < 3.0 else math.nan, height)
        akf.cycle(0.1, math.nan, math.nan, 157.0)
    return akf


@pytest.mark.parametrize("prediction", ["coupled", "still"])
def test_the_barometer_s_bias_is_found(prediction: str) -> None:
    akf = hover(AkfReading(prediction=prediction))  # type: ignore[arg-type]
    assert abs(akf.height - 10.0) < 0.15
    assert abs(akf.x[akf.bias] - 0.5) < 0.15


def test_on_white_sensors_its_nees_is_right() -> None:
    """On the noise that the paper believes in the filter is consistent: 99.9 % of chi-square, 40 runs."""
    errors = []
    for seed in range(40):
        akf = hover(STILL, 60, seed=seed)
        error = akf.x - [10.0, 0.5]
        errors.append(float(error @ np.linalg.solve(akf.p, error)))
    assert 1.0 < np.mean(errors) < 3.3


def test_a_false_echo_high_up_moves_it_by_nothing_in_three_branches_and_far_with_a_constant() -> None:
    for reading, least, most in (
        (AkfReading(), 0.0, 0.3), (AkfReading(gain="constant"), 1.0, 9.0),
        (AkfReading(gain="constant", switch="hardened"), 0.0, 0.3),
    ):  # fmt: skip
        akf = hover(reading)
        before = akf.height
        akf.echo(1.2, 1.2)
        akf.cycle(0.1, math.nan, math.nan, 157.0)
        assert least <= abs(akf.height - before) <= most, reading


@pytest.mark.parametrize("crossed", [True, False])
@pytest.mark.parametrize("switch", ["measured", "hardened"])
def test_the_bias_is_kept_below_three_metres(crossed: bool, switch: str) -> None:
    akf = hover(AkfReading(crossed=crossed, switch=switch, bias_walk=0.0))  # type: ignore[arg-type]
    high = akf.x[akf.bias]
    for k in range(500):
        height = max(2.0, 10.0 - 0.02 * k)
        akf.hear(BARO, height + 0.5 - (2.0 if height < 2.9 else 0.0))  # downwash: not to be listened to below
        akf.hear(GPS, height)
        akf.hear(VISION, height)
        akf.echo(height if height < 3.0 else math.nan, height)
        akf.cycle(0.1, math.nan, math.nan, 157.0)
    assert akf.near
    assert abs(akf.height - 2.0) < 0.02
    assert abs(akf.x[akf.bias] - high) < 0.1


def test_silent_sensors_have_no_row() -> None:
    akf = LeiFilter(STILL)
    akf.hear(GPS, 5.0)
    akf.cycle(0.1, math.nan, math.nan, math.nan)
    assert akf.height == pytest.approx(5.0, abs=0.01)
    spread = akf.p[0, 0]
    akf.cycle(1.0, math.nan, math.nan, math.nan)
    assert akf.p[0, 0] > spread


def test_deviations_are_the_papers() -> None:
    sensors = LeiSensors()
    assert [sensors.variance(s) for s in (BARO, GPS, VISION, SONAR)] == pytest.approx(
        [0.092**2, 0.165**2, 0.351**2, 0.003**2]
    )
