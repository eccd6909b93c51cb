"""Rows that say something: no repeated times, nothing beyond all reason, nothing that stands still."""

from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from flightlog.tables import Table

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

# columns without which a row is worth nothing, and beyond which no sensor of the kind reads
REACH: Mapping[str, Mapping[str, float]] = {
    "imu": dict.fromkeys(("fx", "fy", "fz"), 1e3) | dict.fromkeys(("wx", "wy", "wz"), 100.0),
    "mag": dict.fromkeys(("mx", "my", "mz"), 1e3),
    "baro": {"altitude": 2e4},
    "gps": dict.fromkeys(("e", "n", "u"), 1e7),
    "pad": dict.fromkeys(("x", "y", "z"), 1e3),
    "rotor": {"speed": 6e3},
    "controls": dict.fromkeys(("collective", "lateral", "longitudinal", "tail", "throttle"), 2.0),
}
ALSO: Mapping[str, Mapping[str, float]] = {  # that may be missing
    "gps": dict.fromkeys(("ve", "vn", "vu"), 400.0),
    "sonar": {"range": 1e3},
    "baro": {"pressure": 2e5, "temperature": 400.0},
    "battery": {"voltage": 1e3, "current": 1e4},
}
# [s] for which a working sensor never says one and the same
STILL: Mapping[str, float] = {"imu": 1.0, "pad": 2.0} | dict.fromkeys(("mag", "baro", "gps", "rotor", "controls"), 5.0)
RESTING = ("throttle",)  # may stand still in all of them
# missing where they stand still
BESIDE: Mapping[str, tuple[str, ...]] = {"gps": ("ve", "vn", "vu"), "pad": ("angle",)}
STRAY, TIMES, FAR = 0.1, 10.0, 600.0  # share of rows that may be astray in time; by so often their span and [s]
FEWEST = 10  # rows in which something stands still


def cleaned(table: Table, each: bool = True) -> tuple[Table | None, list[str]]:
    """A topic's rows that can be used, None where none is left, and what must be said of the others.

    each: rows are of no use either where only one of the needed columns stands still.
    """
    base = table.name.split("_")[0]
    notes: list[str] = []
    astray = _astray(np.asarray(table["t"], float))
    if astray.any():
        notes.append(f"{table.name}: {np.count_nonzero(astray)} row(s) far from all others in time; left out")
        table = _of(table, ~astray)
    t = np.asarray(table["t"], float)
    fresh = np.concatenate([[True], np.diff(t) > 0.0]) if len(t) else np.zeros(0, bool)
    if not fresh.all():
        table = _of(table, fresh)
    columns = [c for c in (*REACH.get(base, ()), *ALSO.get(base, ())) if c in table]
    table = _bounded(table, {c: (dict(REACH.get(base, {})) | dict(ALSO.get(base, {})))[c] for c in columns}, notes)
    table = _silenced(table, base, notes)
    needed = [c for c in REACH.get(base, ()) if c in table]
    if not needed:
        return table, notes
    good: Flags = np.asarray(np.isfinite(table.stack(*needed)).all(axis=1))
    still = good & _still(table, base, needed, good, each)
    if still.any():
        notes.append(
            f"{table.name}: stands still in {np.count_nonzero(still)} of {len(table)} rows, which are left out: "
            "the sensor was dead or not connected then"
        )
    good &= ~still
    if not good.any():
        notes.append(f"{table.name}: nothing in it that can be used; left out")
        return None, notes
    return (table if good.all() else _of(table, good)), notes


def _astray(t: Floats) -> Flags:
    """(N,) rows whose time was read wrong: farther from the bulk than many times its length."""
    if len(t) < FEWEST:
        return np.zeros(len(t), bool)
    first, last = np.quantile(t, [STRAY, 1.0 - STRAY])
    reach = TIMES * (last - first) + FAR
    return np.asarray((t < first - reach) | (t > last + reach))


def _bounded(table: Table, reach: Mapping[str, float], notes: list[str]) -> Table:
    """What is infinite or beyond all reason is missing."""
    for name, most in reach.items():
        bad = np.abs(np.asarray(table[name], float)) > most
        if bad.any():
            notes.append(f"{table.name}.{name}: {np.count_nonzero(bad)} value(s) beyond {most:g}; left out")
            table = _without(table, name, bad)
    return table


def _silenced(table: Table, base: str, notes: list[str]) -> Table:
    """What is of use beside the others, and stands still, is missing."""
    t = np.asarray(table["t"], float)
    for name in BESIDE.get(base, ()):
        if name not in table:
            continue
        values = np.asarray(table[name], float)
        at = np.flatnonzero(np.isfinite(values))
        still = np.zeros(len(t), bool)
        still[at] = _runs(t[at], values[at], STILL[base])
        if still.any():
            notes.append(f"{table.name}.{name}: stands still in {np.count_nonzero(still)} of {len(t)} rows; left out")
            table = _without(table, name, still)
    return table


def _without(table: Table, name: str, bad: Flags) -> Table:
    """The table with some values of a column missing."""
    arrow = table.arrow
    field = pa.field(name, pa.float64(), metadata=arrow.schema.field(name).metadata)
    values = np.where(bad, np.nan, np.asarray(table[name], float))
    return Table(table.name, arrow.set_column(arrow.schema.get_field_index(name), field, pa.array(values)), table.topic)


def _still(table: Table, base: str, columns: Sequence[str], good: Flags, each: bool) -> Flags:
    """(N,) rows in which one of the columns, or all of them, are in a run of one and the same."""
    t = np.asarray(table["t"], float)
    at = np.flatnonzero(good)
    least = STILL.get(base, np.inf)
    runs = [_runs(t[at], np.asarray(table[c], float)[at], least) for c in columns if c not in RESTING]
    found = np.zeros(len(t), bool)
    if runs:
        found[at] = np.any(runs, axis=0) if each else np.all(runs, axis=0)
    return found


def _runs(t: Floats, values: Floats, least: float) -> Flags:
    if len(t) < FEWEST:
        return np.zeros(len(t), bool)
    edges = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0.0, [True]]))
    first, last = edges[:-1], edges[1:] - 1
    long = (t[last] - t[first] >= least) & (last - first + 1 >= FEWEST)
    return np.repeat(long, last - first + 1)


def _of(table: Table, rows: Flags) -> Table:
    return Table(table.name, table.arrow.filter(pa.array(rows)), table.topic)


def between(table: Table, first: float, last: float) -> Table:
    """Its rows in a span of time [s]."""
    t = np.asarray(table["t"], float)
    inside = (t >= first) & (t <= last)
    return table if inside.all() else _of(table, inside)
