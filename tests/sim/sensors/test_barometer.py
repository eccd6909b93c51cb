"""The barometer: equation 8, the pad's reading, lag, downwash and drift."""

import math

import numpy as np
import pytest

from flightlog.atmosphere import height_from_pressure, pressure_at
from flightlog.constants import GAS_CONSTANT, GRAVITY

SKID = 0.23  # [m] of the fitted vehicle


@pytest.mark.parametrize("height", [0.23, 2.0, 10.0, 100.0])
def test_without_errors_the_altitude_is_that_of_the_port(bench, height):
    baro = bench.build("baro", perfect=True, lag=0.0, position=(0.5, 0.0, -0.1))
    (sample,) = bench.rest(baro, 1, position=(0, 0, height), pitch=0.3)
    port = height + 0.5 * math.sin(0.3) - 0.1 * math.cos(0.3)
    assert sample.altitude == pytest.approx(port, abs=1e-3)
    assert sample.pressure == pytest.approx(pressure_at(port, 101325.0, 288.15), abs=0.02)


def test_the_pads_reading_takes_out_the_devices_offset(bench):
    heights, pressures = [], []
    for seed in range(300):
        baro = bench.build("baro", seed, perfect=True, lag=0.0, offset_std=100.0)
        (sample,) = bench.rest(baro, 1)
        heights.append(sample.altitude)
        pressures.append(sample.pressure)
        # what Equipment carries as read on the pad gives the same height by equation 8
        assert height_from_pressure(sample.pressure, baro.pad_pressure, baro.pad_temperature) == sample.altitude
    assert np.std(pressures) == pytest.approx(100.0, rel=0.17)
    # 1 hPa of offset moves the scale of the height by 0.1 %: a centimetre at 10 m
    assert np.ptp(heights) < 0.08


def test_what_the_pads_reading_leaves_is_drawn_per_flight(bench):
    n = bench.numbers("baro")
    errors = []
    for seed in range(400):
        baro = bench.build("baro", seed, noise=0.0, temperature_noise=0.0, drift_std=0.0)
        (sample,) = bench.rest(baro, 1)
        errors.append(sample.altitude - 10.0 + 0.02)
        # 0.5 K of the thermometer is 2 cm at 10 m, 1 hPa one
        assert errors[-1] == pytest.approx(sum(baro.errors()), abs=0.12)
    assert np.std(errors) == pytest.approx(n["bias_std"], rel=0.15)
    assert abs(np.mean(errors)) < 4 * np.std(errors) / 20


def test_drift_and_noise_in_flight_as_declared(bench):
    # a fifth of the declared time constant makes the run short; the deviation is the declared one
    n = bench.numbers("baro")
    baro = bench.build("baro", 5, perfect=True, lag=0.0, drift_std=n["drift_std"], drift_tau=2.0, noise=n["noise"])
    x = np.array([sample.altitude for sample in bench.rest(baro, 60_000)])
    assert x.std() == pytest.approx(math.hypot(n["drift_std"], n["noise"]), rel=0.12)
    assert np.std(np.diff(x)) / math.sqrt(2) == pytest.approx(n["noise"], rel=0.1)
    lag = 100  # 2 s
    y = x - x.mean()
    assert np.mean(y[lag:] * y[:-lag]) / n["drift_std"] ** 2 == pytest.approx(math.exp(-1), abs=0.12)


def test_hover_looks_like_the_published_one(bench):
    # Lei 2012, hover of about a minute: mean |error| 0.674 m, standard deviation 0.369 m; one flight of many
    means, deviations = [], []
    for seed in range(60):
        x = np.array([s.altitude for s in bench.rest(bench.build("baro", seed), 3000)]) - 10.0
        means.append(np.mean(np.abs(x)))
        deviations.append(np.std(x))
    assert 0.3 < np.mean(means) < 0.8
    assert 0.1 < np.mean(deviations) < 0.4
    assert np.quantile(means, 0.98) > 0.674


@pytest.mark.parametrize("lag", [0.05, 0.5])
def test_a_step_of_height_arrives_with_the_lag(bench, truth, lag):
    baro = bench.build("baro", perfect=True, lag=lag)
    step = list(bench.run(baro, 200, lambda t: truth(t, position=(0, 0, 10.0 if t < 0.01 else 15.0))))
    t = np.arange(200) / 50.0
    share = (np.array([s.altitude for s in step]) - step[0].altitude) / 5.0
    np.testing.assert_allclose(share, 1.0 - np.exp(-t / lag), atol=2e-3)


def test_downwash_makes_it_read_low_by_the_disc_loading_and_dies_away(bench):
    gain, scale, thrust = 0.8, 0.4, 49.0
    loading = thrust / (math.pi * bench.site.rotor_radius**2)

    def error(skids, **changed):
        clean, blown = (bench.build("baro", perfect=True, lag=0.0, **more) for more in ({}, changed))
        place = {"position": (0, 0, SKID + skids), "thrust": thrust}
        (a,), (b,) = bench.rest(clean, 1, **place), bench.rest(blown, 1, **place)
        assert b.pressure - a.pressure == pytest.approx(-blown.errors()[2] * a.pressure / GAS_CONSTANT / a.temperature
                                                        * GRAVITY, rel=1e-2)  # fmt: skip
        return b.altitude - a.altitude

    weight = 1.225 * GRAVITY
    at_touchdown = error(0.0, downwash_gain=gain, downwash_height_scale=scale)
    assert at_touchdown == pytest.approx(-gain * loading / weight, rel=0.01)
    assert -2.5 < at_touchdown < -1.5  # up to 2.5 m for this aircraft
    for skids in (0.2, 0.4, 0.8):
        blown = error(skids, downwash_gain=gain, downwash_height_scale=scale)
        assert blown / at_touchdown == pytest.approx(math.exp(-skids / scale), rel=0.01)
    assert abs(error(1.5 * 0.73, downwash_gain=gain, downwash_height_scale=scale)) < 0.07 * abs(at_touchdown)
    # an infinite scale: proportional to thrust at any height
    assert error(9.0, downwash_gain=gain, downwash_height_scale=math.inf) == pytest.approx(at_touchdown, rel=0.01)


def test_suction_of_the_wind_makes_it_read_high(bench):
    still, windy = (bench.build("baro", perfect=True, lag=0.0, port_coefficient=-0.2) for _ in range(2))
    (a,), (b,) = bench.rest(still, 1), bench.rest(windy, 1, wind=(6.0, 8.0, 0.0))
    assert b.pressure - a.pressure == pytest.approx(-0.2 * 0.5 * 1.225 * 100.0, rel=0.01)
    assert b.altitude - a.altitude == pytest.approx(1.02, rel=0.02)


def test_a_steady_drift_can_be_set(bench):
    baro = bench.build("baro", perfect=True, lag=0.0, drift_rate=0.02)
    *_, last = bench.rest(baro, 501)
    assert last.altitude == pytest.approx(10.0 - 0.02 + 0.2, abs=2e-3)
    assert baro.errors()[1] == pytest.approx(0.2004, abs=1e-9)


def test_after_silence_the_lag_is_over(bench, truth):
    baro = bench.build("baro", perfect=True, lag=0.1)
    baro.sample(truth(0.0, position=(0, 0, 10.0)))
    sample = baro.sample(truth(5.0, position=(0, 0, 4.0)))
    assert sample.altitude == pytest.approx(4.0 - 0.02, abs=1e-3)
