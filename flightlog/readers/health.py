"""What is doubtful in a log's tables: gaps, runs of NaN, channels that never change."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from flightlog.tables import Table

LONG_GAP = 10.0  # times the usual step
LEAST_GAP = 1.0  # [s]
LEAST_ROWS = 20  # a channel of fewer says nothing by being constant
LONG_SILENCE = 1.0  # [s] of NaN

NOW_AND_THEN = ("sonar", "pad", "horizon", "flow")  # topics that say NaN where there is nothing to see or hear

# channels in which a working sensor is never quiet
NOISY = {
    "imu": ("fx", "fy", "fz", "wx", "wy", "wz"),
    "mag": ("mx", "my", "mz"),
    "baro": ("pressure", "altitude"),
    "gps": ("e", "n", "u"),
    "sonar": ("range",),
    "flow": ("u", "v"),
    "rotor": ("speed",),
    "battery": ("voltage",),
    "estimate": ("e", "n", "u", "roll", "pitch", "heading"),
    "reference": ("e", "n", "u", "roll", "pitch", "heading"),
}


def look(tables: Mapping[str, Table]) -> Iterator[str]:
    """A line for every doubt."""
    for name, table in tables.items():
        yield from _gaps(name, table)
        base = name.split("_")[0]
        for column in table.columns:
            values = table[column]
            if column in ("t", "t_arrival") or values.dtype.kind != "f":
                continue
            if base in NOW_AND_THEN and np.isfinite(values).any():
                continue
            yield from _silences(f"{name}.{column}", table["t"], values)
            finite = values[np.isfinite(values)]
            if column in NOISY.get(base, ()) and len(finite) >= LEAST_ROWS and np.ptp(finite) == 0.0:
                yield f"{name}.{column}: {finite[0]:g} throughout: the channel is dead or was not connected"


def _gaps(name: str, table: Table) -> Iterator[str]:
    steps = np.diff(table["t"])
    usual = float(np.median(steps)) if len(steps) else 0.0
    wide = np.flatnonzero(steps > max(LEAST_GAP, LONG_GAP * usual))
    wide = np.setdiff1d(wide, np.asarray(table.segments) - 1)
    if len(wide):
        longest = wide[np.argmax(steps[wide])]
        start = table["t"][longest]
        yield f"{name}: {len(wide)} gap(s), the longest {steps[longest]:.1f} s from t = {start:.3f} s"


def _silences(channel: str, t: NDArray[np.float64], values: NDArray[np.float64]) -> Iterator[str]:
    missing = ~np.isfinite(values)
    if not missing.any():
        return
    if missing.all():
        yield f"{channel}: NaN throughout"
        return
    edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]]).astype(np.int8)))
    starts, ends = edges[::2], np.minimum(edges[1::2], len(t) - 1)
    spans = t[ends] - t[starts]
    longest = int(np.argmax(spans))
    share = f"{channel}: NaN in {np.count_nonzero(missing)} of {len(values)} rows"
    if spans[longest] > LONG_SILENCE:
        share += f", the longest run {spans[longest]:.1f} s from t = {t[starts[longest]]:.3f} s"
    yield share
