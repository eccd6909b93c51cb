"""Units that are plainly wrong, found by what a flight must look like; a mapping may have declared otherwise.

Bounds are wide: what they refuse is no flight in SI units. Then channels that measure one thing are held against each
other, where a factor of a usual wrong unit between them is the only sensible reading.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightlog.constants import GRAVITY
from flightlog.errors import UserError
from flightlog.tables import Table
from flightlog.units import units_of

Floats = NDArray[np.float64]
Tables = Mapping[str, Table]

LEAST = 10  # values below which a column is not judged
FORCE = (3.0, 40.0)  # [m/s^2] median of |f|: neither falling nor turning at 4 g all the time
ANGLES = {"roll": 3.2, "pitch": 1.6, "heading": 7.0}  # [rad] half, a quarter and a whole turn
WINDING = 7.0  # [rad] of a joint
FASTEST = 40.0  # [rad/s] 99 % of a body's rates are slower; gyroscopes end at 2000 deg/s = 35 rad/s
PRESSURE = (2e4, 1.2e5)  # [Pa] up to 12 km
TEMPERATURE = (180.0, 360.0)  # [K]
FIELD = (10.0, 120.0)  # [uT] the Earth's is 22 to 67, near motors somewhat more
VOLTAGE = 1000.0  # [V]
SLOWEST = 2.0  # [s] between the rows of the densest topic
WINDOW = 0.15  # of a factor, in which it is recognised
ALIKE = 0.9  # correlation above which two channels move together
MOVED = 0.5  # [m] heights that vary less are not compared
TURNED = 0.02  # [rad] angles that vary less are not compared


@dataclass(frozen=True)
class Fault:
    """One wrong unit."""

    channel: str
    found: str
    right: str  # what would be right
    unit: str | None  # the likely unit

    def line(self, path: Path) -> str:
        """The error's line."""
        likely = f"; the values are likely in {self.unit}: declare unit = \"{self.unit}\" in a mapping, or convert them"
        return f"{path}: {self.channel}: {self.found}; {self.right}{likely if self.unit else ''}"


def check(path: Path, tables: Tables) -> None:
    """Raise UserError for the first wrong unit, with the likely right one."""
    for fault in (*_times(tables), *_bounds(tables), *_heights(tables), *_rates(tables), *_velocities(tables)):
        raise UserError(fault.line(path))


def _finite(table: Table, *columns: str) -> Floats:
    """Rows (N, len(columns)) in which all columns are numbers; empty where one is missing."""
    if not all(column in table and table[column].dtype.kind in "fiub" for column in columns):
        return np.empty((0, len(columns)))
    values = table.stack(*columns)
    return values[np.isfinite(values).all(axis=1)]


def _likely(value: float, right: float, si: str) -> str | None:
    """The unit in which a quantity of about `right` in SI reads `value`."""
    factors = {unit: abs(np.log(value * factor / right)) for unit, factor in units_of(si).items() if value > 0.0}
    best = min(factors.values(), default=np.inf)
    # of units that differ by a few per cent (cm/s^2 and a thousandth of gravity) the first is the usual one
    return next((unit for unit, off in factors.items() if off < min(best + np.log(1.1), np.log(3.0))), None)


def _times(tables: Tables) -> Iterator[Fault]:
    steps = {name: float(np.median(np.diff(table["t"]))) for name, table in tables.items() if len(table) >= LEAST}
    if not steps:
        return
    name = min(steps, key=lambda topic: steps[topic])
    if steps[name] >= SLOWEST:
        unit = _likely(steps[name], 0.02, "s") or ("ms" if steps[name] < 2e3 else "us" if steps[name] < 2e6 else "ns")
        yield Fault("time", f"{name}, the densest topic, has a row every {steps[name]:g} s", "seconds are wanted", unit)


def _bounds(tables: Tables) -> Iterator[Fault]:
    """Every column by itself."""
    for name, table in tables.items():
        base = name.split("_")[0]
        if base == "imu":
            force = _size(table, "fx", "fy", "fz")
            if force and not FORCE[0] <= force <= FORCE[1]:
                found = f"median |f| is {force:.4g} m/s^2"
                yield Fault(f"{name}.fx, fy, fz", found, f"a hover has {GRAVITY:.1f}",
                            _likely(force, GRAVITY, "m/s^2"))  # fmt: skip
            for axis in ("wx", "wy", "wz"):
                yield from _above(name, table, axis, FASTEST, "a body turns slower than 35 rad/s", "deg/s", 99.0)
        if base == "mag":
            field = _size(table, "mx", "my", "mz")
            if field and not FIELD[0] <= field <= FIELD[1]:
                unit = _likely(field, 48.0, "uT")
                if unit is not None:
                    found = f"median of the field is {field:.4g} uT"
                    yield Fault(f"{name}.mx, my, mz", found, "the Earth's is 22 to 67 uT", unit)
        if base == "baro":
            yield from _median(name, table, "pressure", "Pa", PRESSURE, 1e5, "air has about 100000 Pa", None)
            yield from _median(name, table, "temperature", "K", TEMPERATURE, 290.0, "air has about 290 K", "degC")
        if base in ("estimate", "reference", "horizon"):
            for angle, most in ANGLES.items():
                yield from _above(name, table, angle, most, f"in rad it is at most {most:g}", "deg", 99.0)
        if base == "joints":
            for joint in table.columns:
                if joint != "t" and table.unit(joint) in (None, "rad"):
                    yield from _above(name, table, joint, WINDING, "a joint turns by less than 7 rad", "deg", 99.0)
        if base == "battery":
            yield from _above(name, table, "voltage", VOLTAGE, "a battery has less than 1000 V", "mV", 50.0)
        if base == "rotor":
            for column in table.columns:
                if column.startswith("speed"):
                    yield from _above(name, table, column, 6000.0, "a rotor turns slower than 6000 rad/s", "rpm", 90.0)
        if base in ("controls", "actuators"):
            for column in table.columns:
                known = table.topic is not None and table.topic.column(column) is not None and column[0] == "m"
                if known and (most := float(np.max(_finite(table, column), initial=0.0))) > 2.0:
                    yield Fault(f"{name}.{column}", f"reaches {most:g}", f"motor commands lie in 0 .. 1: "
                                f"scale it, by {_scale(most)}", None)  # fmt: skip


def _scale(most: float) -> str:
    """What brings a motor command of another kind into 0 .. 1."""
    if most <= 110.0:
        return "1/100 (percent)"
    if most <= 1000.0:
        return "1/1000"
    if most <= 2500.0:
        return "1/1000 with an offset of -1 (pulses of 1000 to 2000 us)"
    return "1/65535 (16 bits)"


def _size(table: Table, *columns: str) -> float:
    """Median length of a vector; 0.0 where there is none to judge, or nothing but zeros."""
    rows = _finite(table, *columns)
    return float(np.median(np.linalg.norm(rows, axis=1))) if len(rows) >= LEAST else 0.0


def _above(
    name: str, table: Table, column: str, limit: float, right: str, unit: str, percentile: float
) -> Iterator[Fault]:
    values = _finite(table, column)
    if len(values) < LEAST:
        return
    most = float(np.percentile(np.abs(values), percentile))
    if most > limit:
        si = table.unit(column) or ""
        yield Fault(f"{name}.{column}", f"reaches {most:.4g} {si}", right, unit)


def _median(
    name: str, table: Table, column: str, si: str, within: tuple[float, float], typical: float, right: str,
    unit: str | None,
) -> Iterator[Fault]:  # fmt: skip
    values = _finite(table, column)
    middle = float(np.median(values)) if len(values) >= LEAST else 0.0
    if middle != 0.0 and not within[0] <= middle <= within[1]:
        found = f"median is {middle:.4g} {si}"
        yield Fault(f"{name}.{column}", found, right, unit or _likely(middle, typical, si))


def _heights(tables: Tables) -> Iterator[Fault]:
    """Heights that move together but not by as much: one is in another unit."""
    known = {"baro": "altitude", "gps": "u", "reference": "u", "estimate": "u", "sonar": "range"}
    series = {}
    for topic, column in known.items():
        if topic not in tables or (column not in tables[topic]):
            continue
        rows = _finite(tables[topic], "t", column)
        if topic in ("gps", "sonar") and "valid" in tables[topic]:
            rows = _finite(tables[topic], "t", column, "valid")
            rows = rows[rows[:, 2] > 0.0]
        if len(rows) >= LEAST:
            series[f"{topic}.{column}"] = rows
    for one, other in combinations(series, 2):
        a, b = _together(series[one], series[other])
        if len(a) < LEAST or min(np.ptp(a), np.ptp(b)) < MOVED:
            continue
        spread_a, spread_b = np.std(a), np.std(b)
        ratio = spread_a / spread_b
        if np.corrcoef(a, b)[0, 1] < ALIKE or 0.05 < ratio < 20.0:
            continue
        # the larger numbers are of the smaller unit
        wrong, right, factor = (one, other, ratio) if ratio > 1.0 else (other, one, 1.0 / ratio)
        unit = "cm" if 0.6 * 100 < factor < 160.0 else "mm" if 600.0 < factor < 1600.0 else None
        yield Fault(wrong, f"moves {factor:.0f} times as far as {right}", "both are heights in m", unit)


def _together(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Second columns of two series (N, 2) of (t, value) at the times of the first that both cover."""
    both = (a[:, 0] >= b[0, 0]) & (a[:, 0] <= b[-1, 0])
    return a[both, 1], np.interp(a[both, 0], b[:, 0], b[:, 1])


def _slope(fast: Floats, rate: Floats) -> float | None:
    """By how much (t, value) changes for a unit of the integral of (t, rate); None where they do not go together."""
    if len(fast) < LEAST or len(rate) < LEAST:
        return None
    steps = np.diff(rate[:, 0])
    sound = (steps > 0.0) & (steps < 1.0)
    integral = np.concatenate([[0.0], np.cumsum(np.where(sound, steps * rate[1:, 1], 0.0))])
    values, integrated = _together(fast, np.column_stack([rate[:, 0], integral]))
    # over about a second, so that neither noise nor slow drift counts
    if len(values) < LEAST:
        return None
    usual = max(1e-3, float(np.median(np.diff(fast[:, 0]))))
    stride = max(1, round(0.5 / usual))
    moved, expected = values[stride:] - values[:-stride], integrated[stride:] - integrated[:-stride]
    if len(moved) < LEAST or np.std(moved) == 0.0 or np.std(expected) == 0.0:
        return None
    if np.corrcoef(moved, expected)[0, 1] < ALIKE:
        return None
    return float(np.sum(moved * expected) / np.sum(expected**2))


def _rates(tables: Tables) -> Iterator[Fault]:
    """Body rates against the angles that they turn."""
    if "imu" not in tables:
        return
    for topic in ("reference", "estimate"):
        if topic not in tables:
            continue
        for angle, axis, sign in (("roll", "wx", 1.0), ("pitch", "wy", -1.0)):
            angles, rates = _finite(tables[topic], "t", angle), _finite(tables["imu"], "t", axis)
            if len(angles) < LEAST or np.std(angles[:, 1]) < TURNED:
                continue
            slope = _slope(angles, rates * np.array([1.0, sign]))
            if slope is not None and abs(slope * 180.0 / np.pi - 1.0) < 2.0 * WINDOW:
                found = f"their integral is 57 times the change of {topic}.{angle}"
                yield Fault("imu.wx, wy, wz", found, "rad/s are wanted", "deg/s")
            if slope is not None and abs(slope * np.pi / 180.0 - 1.0) < 2.0 * WINDOW:
                found = f"changes by 57 times the integral of imu.{axis}"
                yield Fault(f"{topic}.{angle}", found, "rad are wanted", "deg")


def _velocities(tables: Tables) -> Iterator[Fault]:
    """Velocities against the positions that they lead to."""
    for topic in ("gps", "reference", "estimate"):
        if topic not in tables:
            continue
        for axis in ("e", "n", "u"):
            place, speed = _finite(tables[topic], "t", axis), _finite(tables[topic], "t", f"v{axis}")
            if len(place) < LEAST or np.ptp(place[:, 1]) < MOVED:
                continue
            slope = _slope(place, speed)
            for unit, factor in (("cm", 1e-2), ("mm", 1e-3)):
                if slope is not None and abs(slope / factor - 1.0) < 2.0 * WINDOW:
                    found = f"their integral is {1.0 / factor:.0f} times the change of {axis}"
                    yield Fault(f"{topic}.v{axis}", found, "m/s are wanted", f"{unit}/s")
                if slope is not None and abs(slope * factor - 1.0) < 2.0 * WINDOW:
                    found = f"changes by {1.0 / factor:.0f} times the integral of v{axis}"
                    yield Fault(f"{topic}.{axis}", found, "m are wanted", unit)
