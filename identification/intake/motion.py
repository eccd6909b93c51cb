"""Positions against their velocities, and the mark's angle against the turning: axes, signs and units."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightlog.errors import UserError
from flightlog.tables import Table

Floats = NDArray[np.float64]

SPAN = 1.0  # [s] over which changes are compared
LEAST = 30  # rows that both have
ALIKE, APART = 0.9, 0.5  # correlation from which on two changes are one motion, below which they are not
UNITS = ((1.0 / 0.2778, "km/h"), (1.0 / 0.3048, "ft/s"), (1.0 / 0.5144, "kn"))
WITHIN = 0.25  # of a factor between units
TURNS = 57.3  # [deg] of a radian


def check(name: str, tables: Mapping[str, Table]) -> None:
    """Raise UserError where the receiver's axes or units, or the angle's unit, are plainly others."""
    if "gps" in tables:
        _receiver(name, tables["gps"])
    if "pad" in tables and "imu" in tables:
        _angle(name, tables["pad"], tables["imu"])


def _receiver(name: str, gps: Table) -> None:
    if not all(f"v{axis}" in gps for axis in "enu"):
        return
    for axis, other in (("e", "n"), ("n", "e")):
        own, crossed = _likeness(gps, gps, axis, f"v{axis}"), _likeness(gps, gps, axis, f"v{other}")
        if own is not None and crossed is not None and abs(own[0]) < APART and abs(crossed[0]) > ALIKE:
            raise UserError(
                f"{name}: gps.{axis} changes as gps.v{other} says, not as v{axis}: columns are likely swapped"
            )
    for axis in "enu":
        found = _likeness(gps, gps, axis, f"v{axis}")
        if found is None:
            continue
        alike, slope = found
        if alike < -ALIKE:
            raise UserError(f"{name}: gps.{axis} falls when gps.v{axis} says that it rises: one has the wrong sign")
        if alike < ALIKE or slope > 1.0 / (1.0 + 2.0 * WITHIN):
            continue
        unit = min(UNITS, key=lambda pair: abs(np.log(slope * pair[0])))
        if abs(np.log(slope * unit[0])) < WITHIN:
            raise UserError(
                f"{name}: gps.v{axis}: {1.0 / slope:.2g} times as fast as gps.{axis} changes; m/s are wanted: it is "
                f"likely in {unit[1]}"
            )


def _angle(name: str, pad: Table, imu: Table) -> None:
    found = _likeness(pad, imu, "angle", "wz")
    if found is not None and abs(found[0]) > ALIKE and abs(found[1]) > 0.5 * TURNS:
        raise UserError(
            f"{name}: pad.angle changes {abs(found[1]):.0f} times as far as imu.wz turns; rad are wanted: it is likely "
            'in deg, declare unit = "deg" in a mapping'
        )


def _likeness(place: Table, rate: Table, value: str, speed: str) -> tuple[float, float] | None:
    """Correlation, and slope, of a value's changes over a span with the integral of a rate; None where it rests."""
    rows = [np.column_stack([np.asarray(table["t"], float), np.asarray(table[column], float)])
            for table, column in ((place, value), (rate, speed))]  # fmt: skip
    here, there = (part[np.isfinite(part).all(axis=1)] for part in rows)
    if min(len(here), len(there)) < LEAST:
        return None
    grown = np.concatenate([[0.0], np.cumsum(0.5 * (there[1:, 1] + there[:-1, 1]) * np.diff(there[:, 0]))])
    begin, end = max(here[0, 0], there[0, 0]), min(here[-1, 0], there[-1, 0]) - SPAN
    t = here[(here[:, 0] >= begin) & (here[:, 0] <= end), 0]
    if len(t) < LEAST:
        return None
    moved = np.interp(t + SPAN, *here.T) - np.interp(t, *here.T)
    told = np.interp(t + SPAN, there[:, 0], grown) - np.interp(t, there[:, 0], grown)
    if np.std(moved) == 0.0 or np.std(told) == 0.0:
        return None
    return float(np.corrcoef(moved, told)[0, 1]), float(moved @ told / (told @ told))
