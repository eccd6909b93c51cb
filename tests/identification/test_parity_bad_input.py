"""Whatever stands in a log, parity answers or says in a line what is wrong; broken rows are blamed on no sensor."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flightlog.errors import UserError
from identification.parity import judge
from tests.identification.everyday_log import Made, everyday

CHANNELS = (("baro", "altitude"), ("gps", "u"), ("gps", "vu"), ("gps", "e"), ("gps", "hdop"), ("sonar", "range"),
            ("controls", "throttle"), ("baro", "t"), ("gps", "t"))  # fmt: skip
DRIFTS = {"baro_drift", "gps_drift"}


def spoil(made: Made, channel: tuple[str, str], how: str, at: float, length: float) -> None:
    topic, column = channel
    values = made.columns[topic][column].copy()
    first = int(at * len(values))
    rows = slice(first, first + max(1, int(length * (len(values) - first))))
    if column == "t":  # the clock may only stand, or leap ahead: readers sort rows
        values[rows.start :] += 1000.0 * length if how == "huge" else 0.0
    elif how == "nan":
        values[rows] = np.nan
    elif how == "stuck":
        values[rows] = values[first]
    elif how == "huge":
        values[rows] = 1e30
    elif how == "infinite":
        values[rows] = np.inf
    elif how == "zero":
        values[rows] = 0.0
    made.columns[topic][column] = values


@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 5),
    faults=st.lists(
        st.tuples(st.sampled_from(CHANNELS), st.sampled_from(["nan", "stuck", "huge", "infinite", "zero"]),
                  st.floats(0.0, 0.95), st.floats(0.0, 1.0)),
        min_size=1, max_size=3,
    ),
)  # fmt: skip
def test_spoilt_logs_are_answered_or_refused(
    seed: int, faults: list[tuple[tuple[str, str], str, float, float]]
) -> None:
    made = everyday(seed, duration=60.0)
    for fault in faults:
        spoil(made, *fault)
    try:
        verdict = judge({"flight": made.tables()})
    except UserError as error:
        assert "\n" not in str(error)
        return
    for cause in verdict.causes:
        assert all(np.isfinite([f.value, f.std, *f.ci95]).all() for f in cause.parameters.values())


@pytest.mark.parametrize("how", ["nan", "stuck"])
@pytest.mark.parametrize("channel", [("baro", "altitude"), ("gps", "u"), ("gps", "vu"), ("sonar", "range")])
def test_silent_and_stuck_spans_are_blamed_on_no_sensor(channel: tuple[str, str], how: str) -> None:
    made = everyday(11, duration=90.0)
    spoil(made, channel, how, 0.3, 0.4)
    assert judge({"flight": made.tables()}).causes == []


def test_swapped_barometer_and_receiver_are_blamed_for_nothing() -> None:
    made = everyday(12, duration=90.0)
    baro, gps = made.columns["baro"], made.columns["gps"]
    baro["altitude"], gps["u"] = (
        np.interp(baro["t"], gps["t"], gps["u"]),
        np.interp(gps["t"], baro["t"], baro["altitude"]),
    )
    assert judge({"flight": made.tables()}).causes == []


@pytest.mark.parametrize("duration", [60.0, 10800.0])
def test_a_minute_or_three_hours(duration: float) -> None:
    assert not DRIFTS & {cause.name for cause in judge({"flight": everyday(13, duration=duration).tables()}).causes}
