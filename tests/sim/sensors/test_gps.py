"""The GPS: antenna, latency, bias, wander, white noise, satellites."""

import math

import numpy as np
import pytest


def positions(samples):
    return np.array([[s.e, s.n, s.u] for s in samples])


def test_without_errors_it_gives_position_and_velocity_of_the_antenna(bench):
    gps = bench.build("gps", perfect=True, position=(-0.6, 0.0, 0.1))
    # heading east, turning left at 1 rad/s: the tail swings to the south, as left is north
    (sample,) = bench.rest(
        gps, 1, position=(1.0, 2.0, 3.0), heading=math.pi / 2, velocity=(0.5, 0.0, 0.2), rates=(0, 0, 1.0)
    )
    assert (sample.e, sample.n, sample.u) == pytest.approx((1.0 - 0.6, 2.0, 3.1))
    assert (sample.ve, sample.vn, sample.vu) == pytest.approx((0.5, -0.6, 0.2))
    assert sample.valid


def test_it_arrives_late_and_says_for_when(bench, truth):
    gps = bench.build("gps", perfect=True, latency=0.18)
    sample = gps.sample(truth(7.0))
    assert sample.t == 7.0
    assert sample.t_arrival == pytest.approx(7.18)


def test_a_delay_that_the_receiver_does_not_know_shows_in_what_it_says(bench, truth):
    gps = bench.build("gps", perfect=True, latency=0.18, delay=0.25, position=(0, 0, 0))
    sample = gps.sample(truth(7.0, position=(7.0, 0.0, 10.0)))  # flying east at 1 m/s
    assert sample.t - sample.e == pytest.approx(0.25)  # stamped later than where it was
    assert sample.t_arrival - sample.t == pytest.approx(0.18)


def test_bias_is_drawn_per_flight(bench):
    n = bench.numbers("gps")
    errors = np.array([
        positions(bench.rest(bench.build("gps", seed, perfect=True, bias_std=n["bias_std"],
                                         bias_std_up=n["bias_std_up"]), 1))[0]
        for seed in range(600)
    ])  # fmt: skip
    np.testing.assert_allclose(errors.std(axis=0), [n["bias_std"], n["bias_std"], n["bias_std_up"]], rtol=0.12)


def test_wander_is_a_gauss_markov_process_that_starts_anywhere(bench):
    n = bench.numbers("gps")
    tau = 60.0
    flights = np.array([
        positions(bench.rest(bench.build("gps", seed, perfect=True, wander_std=n["wander_std"],
                                         wander_std_up=n["wander_std_up"], wander_tau=tau), 151))[::150]
        for seed in range(300)
    ])  # fmt: skip
    for k in (0, 1):
        np.testing.assert_allclose(
            flights[:, k].std(axis=0), [n["wander_std"], n["wander_std"], n["wander_std_up"]], rtol=0.17
        )
    correlation = [np.corrcoef(flights[:, 0, i], flights[:, 1, i])[0, 1] for i in range(3)]
    np.testing.assert_allclose(correlation, math.exp(-30.0 / tau), atol=0.15)


def test_white_noise_of_position_and_velocity(bench):
    n = bench.numbers("gps")
    white = {name: n[name] for name in ("noise", "noise_up", "velocity_noise")}
    samples = list(bench.rest(bench.build("gps", 1, perfect=True, **white), 10_000))
    x = positions(samples)
    np.testing.assert_allclose(x.std(axis=0), [n["noise"], n["noise"], n["noise_up"]], rtol=0.04)
    v = np.array([[s.ve, s.vn, s.vu] for s in samples])
    np.testing.assert_allclose(v.std(axis=0), n["velocity_noise"], rtol=0.04)


def test_height_looks_like_the_published_one(bench):
    # Lei 2012, hover: mean |error| 0.538 m, standard deviation 0.253 m
    means, deviations = [], []
    for seed in range(100):
        u = positions(bench.rest(bench.build("gps", seed), 300))[:, 2] - 10.08
        means.append(np.mean(np.abs(u)))
        deviations.append(np.std(u))
    assert 0.3 < np.mean(means) < 0.65
    assert 0.1 < np.mean(deviations) < 0.3


def test_fewer_satellites_mean_more_noise_and_below_four_no_fix(bench):
    many, few, none = (
        bench.build("gps", 1, perfect=True, noise=0.1, satellites=satellites) for satellites in (9, 5, 3)
    )
    (a,), (b,), (c,) = (bench.rest(gps, 1) for gps in (many, few, none))
    assert (a.satellites, b.satellites, c.satellites) == (9, 5, 3)
    ratio = math.sqrt(9 / 5)
    assert b.hdop / a.hdop == pytest.approx(ratio)
    antenna = -0.60  # heading north, the antenna on the boom
    assert (b.n - antenna) / (a.n - antenna) == pytest.approx(ratio)
    assert a.valid
    assert b.valid
    assert not c.valid
    assert math.isnan(c.e)
    assert c.t_arrival > c.t, "also news of no fix takes its time"


def test_fixed_bias_and_steady_drift_can_be_set(bench):
    gps = bench.build("gps", perfect=True, bias_u=1.5, drift_rate_e=0.1, position=(0, 0, 0))
    *_, last = bench.rest(gps, 51)
    assert last.u == pytest.approx(11.5)
    assert last.e == pytest.approx(51 * 0.2 * 0.1)
    assert gps.errors() == pytest.approx((1.02, 0.0, 1.5))
