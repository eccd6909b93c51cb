"""Whatever is done to a flight's tables, the intake of a diagnosis answers with flights or with one line."""

import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flightlog.errors import UserError
from identification.intake import sound
from identification.logs import read
from sim.kinds import load
from tests.identification.short_flight import Columns, copied, written

HOW = ("nan", "stuck", "huge", "infinite", "zero", "lost", "column lost", "reversed", "scaled", "reset", "doubled")


def spoil(columns: Columns, topic: str, place: float, how: str, at: float, length: float) -> None:
    table = columns.get(topic)
    if table is None or "t" not in table:
        return
    names = list(table)
    name = names[int(place * len(names))]
    count = len(table["t"])
    rows = slice(int(at * count), min(count, int(at * count) + max(1, int(length * count))))
    if how in ("lost", "doubled"):
        index = np.delete(np.arange(count), rows) if how == "lost" else np.sort(np.r_[0:count, rows])
        columns[topic] = {column: values[index] for column, values in table.items()}
    elif how == "column lost":
        del table[name]
    elif how == "reset":
        table["t"] = np.concatenate([table["t"][: rows.start], table["t"][rows.start :] - 10.0 * length])
    else:
        values = np.array(table[name], float if table[name].dtype.kind == "f" else table[name].dtype)
        part = values[rows]
        if how == "reversed":
            values[rows] = part[::-1]
        elif values.dtype.kind == "f":
            said = {
                "nan": np.nan,
                "stuck": part[:1],
                "huge": 1e30,
                "infinite": np.inf,
                "zero": 0.0,
                "scaled": 57.3 * part,
            }
            values[rows] = said[how]
        table[name] = values


@pytest.fixture(scope="module")
def vehicles():
    return [load(name) for name in ("raptor90", "crazyflie", "lab_helicopter")] + [None]


@settings(max_examples=80, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    faults=st.lists(st.tuples(
        st.sampled_from(("imu", "controls", "rotor", "baro", "gps", "mag", "pad", "sonar")), st.floats(0.0, 0.99),
        st.sampled_from(HOW), st.floats(0.0, 0.99), st.floats(0.0, 1.0),
    ), min_size=1, max_size=4),
    which=st.integers(0, 3),
)  # fmt: skip
def test_any_faults_are_flights_or_one_clear_line(flown, vehicles, tmp_path_factory, faults, which) -> None:
    columns = copied(flown)
    for fault in faults:
        spoil(columns, *fault)
    log = written({topic: table for topic, table in columns.items() if table}, tmp_path_factory.mktemp("f") / "flight")
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            flights = sound(read([log]), vehicles[which])
        except UserError as error:
            assert "\n" not in str(error)
            return
    for tables in flights.tables.values():
        for topic, table in tables.items():
            assert np.all(np.diff(table["t"]) > 0.0), topic
