import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightlog.readers import read_flight
from flightlog.replay_series import height_errors, heights, path, thin


def test_every_sensor_gives_the_height_of_the_body_origin(logged, equipment):
    flight = read_flight(logged.folder)
    found = heights(flight.measured, flight.truth, equipment)
    assert set(found) == {"truth", "fusion", "baro", "gps", "sonar", "vision"}
    for name, offset in {"truth": 0.0, "fusion": 0.05, "baro": 0.5, "gps": 0.0, "sonar": 0.0, "vision": 0.0}.items():
        series = found[name]
        assert len(series.t) > 5, name
        np.testing.assert_allclose(series.values, logged.position(series.t)[:, 2] + offset, atol=1e-9, err_msg=name)


def test_invalid_samples_are_left_out(logged, equipment):
    flight = read_flight(logged.folder)
    found = heights(flight.measured, flight.truth, equipment)
    assert found["sonar"].values.max() < 3.2
    assert found["gps"].t[0] > 1.0


def test_errors_are_against_the_truth_at_the_time_of_validity(logged, equipment):
    flight = read_flight(logged.folder)
    errors = height_errors(heights(flight.measured, flight.truth, equipment))
    assert "truth" not in errors
    assert errors["baro"].values == pytest.approx(0.5, abs=1e-9)
    assert errors["vision"].values == pytest.approx(0.0, abs=1e-9)


def test_without_truth_and_equipment_the_sensors_still_show(logged):
    flight = read_flight(logged.folder, truth=False)
    found = heights(flight.measured, {}, None)
    assert set(found) == {"fusion", "baro", "gps", "sonar", "vision"}
    assert height_errors(found) == {}
    np.testing.assert_allclose(found["vision"].values, logged.position(found["vision"].t)[:, 2], atol=0.2)


def test_a_path_keeps_only_known_places(logged):
    t, points = path(read_flight(logged.folder).truth["state"], 10.0)
    assert len(t) == 120
    np.testing.assert_allclose(points, logged.position(t), atol=1e-12)


@given(st.lists(st.floats(0, 50), min_size=1, max_size=60).map(sorted), st.sampled_from([1.0, 10.0, 50.0]))
def test_thinning_keeps_the_first_and_no_more_than_the_rate(times, rate):
    t = np.array(times)
    rows = thin(t, rate)
    assert rows[0] == 0
    assert np.all(np.diff(rows) > 0)
    ticks = np.floor((t[rows] - t[0]) * rate + 1e-6)
    assert np.all(np.diff(ticks) >= 1)
    assert set(np.floor((t - t[0]) * rate + 1e-6)) == set(ticks)


def test_thinning_nothing_gives_nothing():
    assert len(thin(np.zeros(0), 10.0)) == 0
