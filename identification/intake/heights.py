"""Heights against each other where a flight is too short, or too low, for their rates to be told apart by parity."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from flightlog.errors import UserError
from flightlog.tables import Table

Floats = NDArray[np.float64]

KNOWN: Mapping[str, str] = {"baro": "altitude", "gps": "u", "reference": "u", "sonar": "range", "pad": "z"}
LEAST = 20  # rows that both have
MOVED = 1.5  # [m] of both
ALIKE = 0.95  # correlation from which on they are one motion
CONTINUOUS = {"baro.altitude", "gps.u", "reference.u"}  # that can be compared at other times
BETTER = 4.0  # times as near to full correlation at another lag
USUAL, FARTHEST, GRID = 2.0, 12.0, 0.25  # [s] by which one may be late; that is looked at; in steps
UNITS = ((2.4, 4.4, "ft"), (60.0, 160.0, "cm"), (600.0, 1600.0, "mm"))  # by how much one moves further


def check(name: str, tables: Mapping[str, Table]) -> None:
    """Raise UserError where one is upside down, or in another unit."""
    series = {f"{topic}.{column}": _rows(tables[topic], column) for topic, column in KNOWN.items() if topic in tables}
    for one, other in combinations(series, 2):
        a, b = series[one], series[other]
        if len(a) < LEAST or len(b) < LEAST:
            continue
        both = (a[:, 0] >= b[0, 0]) & (a[:, 0] <= b[-1, 0])
        x, y = a[both, 1], np.interp(a[both, 0], b[:, 0], b[:, 1])
        if len(x) < LEAST or min(_extent(a[:, 1]), _extent(b[:, 1])) < MOVED or min(np.ptp(x), np.ptp(y)) == 0.0:
            continue
        alike = float(np.corrcoef(x, y)[0, 1])
        late = _late(a, b, alike) if {one, other} <= CONTINUOUS else None
        if late is not None:
            raise UserError(
                f"{name}: {one} follows {other} {late:+.1f} s late: their clocks differ; one clock would be right, set "
                "one right or leave it out"
            )
        if min(_extent(x), _extent(y)) < MOVED:
            continue
        if alike < -ALIKE:
            raise UserError(
                f"{name}: {one} falls when {other} rises; both should be heights, up positive: one is likely a depth "
                "(NED), set its frame or a scale of -1 in a mapping"
            )
        if alike < ALIKE:
            continue
        ratio = float(np.std(x) / np.std(y))
        wrong, right, factor = (one, other, ratio) if ratio > 1.0 else (other, one, 1.0 / ratio)
        for least, most, unit in UNITS:
            if least < factor < most:
                raise UserError(
                    f"{name}: {wrong} moves {factor:.3g} times as far as {right}; heights are wanted in m: it is "
                    f'likely in {unit}, declare unit = "{unit}" in a mapping'
                )


def _late(a: Floats, b: Floats, together: float) -> float | None:
    """Seconds by which one height follows another, where only that makes them one motion; None otherwise."""
    best = (max(ALIKE, 1.0 - (1.0 - together) / BETTER), 0.0)
    for lag in np.arange(-FARTHEST, FARTHEST + 0.5 * GRID, GRID).tolist():
        both = (a[:, 0] - lag >= b[0, 0]) & (a[:, 0] - lag <= b[-1, 0])
        x, y = a[both, 1], np.interp(a[both, 0] - lag, b[:, 0], b[:, 1])
        if 2 * len(x) < len(a) or min(_extent(x), _extent(y)) < MOVED:
            continue
        best = max(best, (float(np.corrcoef(x, y)[0, 1]), lag))
    return best[1] if abs(best[1]) > USUAL else None


def _rows(table: Table, column: str) -> Floats:
    """(N, 2) of time and value, where they are heard."""
    if column not in table:
        return np.empty((0, 2))
    rows = np.column_stack([np.asarray(table["t"], float), np.asarray(table[column], float)])
    good = np.isfinite(rows).all(axis=1)
    if "valid" in table:
        good &= np.asarray(table["valid"], float) > 0.0
    return np.asarray(rows[good])


def _extent(values: Floats) -> float:
    return float(np.subtract(*np.percentile(values, [97.0, 3.0])))
