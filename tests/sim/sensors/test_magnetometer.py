"""The magnetometer against the field of the site and its declared statistics."""

import math

import numpy as np
import pytest

from flightlog.rotations import matrix, quaternion


@pytest.mark.parametrize("attitude", [(0.0, 0.0, 0.0), (0.2, -0.1, 2.0), (-0.4, 0.3, 5.5)])
def test_it_sees_the_sites_field_in_body_axes(bench, attitude):
    roll, pitch, heading = attitude
    (sample,) = bench.rest(bench.build("mag", perfect=True), 1, roll=roll, pitch=pitch, heading=heading)
    expected = matrix(quaternion(roll, pitch, heading)).T @ bench.site.magnetic_field
    np.testing.assert_allclose(sample[1:], expected, atol=1e-12)


def test_heading_east_puts_north_on_the_left(bench):
    (sample,) = bench.rest(bench.build("mag", perfect=True), 1, heading=math.pi / 2)
    assert sample.my == pytest.approx(22.0)
    assert sample.mx == pytest.approx(1.5)


def test_the_heading_is_off_by_about_a_degree_over_flights(bench):
    errors = []
    for seed in range(400):
        mag = bench.build("mag", seed, noise=0.0)
        (sample,) = bench.rest(mag, 1)
        # level, heading north: y is west
        errors.append(math.degrees(math.atan2(sample.my, sample.mx) - math.atan2(-1.5, 22.0)))
    assert 0.6 < np.std(errors) < 1.2
    assert abs(np.mean(errors)) < 4 * np.std(errors) / math.sqrt(400)


def test_white_noise_and_drift_as_declared(bench):
    n = bench.numbers("mag")
    white = np.array(list(bench.rest(bench.build("mag", 1, perfect=True, noise=n["noise"]), 10_000)))[:, 1:]
    np.testing.assert_allclose(white.std(axis=0), n["noise"], rtol=0.04)
    drift = np.array([
        list(bench.rest(bench.build("mag", seed, perfect=True, drift_std=1.0, drift_tau=1.0), 51))
        for seed in range(500)
    ])[:, :, 1:] - [22.0, -1.5, -42.0]  # heading north: x is north, y is west
    first, later = drift[:, 0, 0], drift[:, 50, 0]
    assert first.std() == pytest.approx(1.0, rel=0.13)
    assert later.std() == pytest.approx(1.0, rel=0.13)
    assert np.corrcoef(first, later)[0, 1] == pytest.approx(math.exp(-1), abs=0.14)
