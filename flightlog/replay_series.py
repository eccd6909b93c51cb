"""What the replay plots, computed from the log's tables.

All heights are the body origin's above the pad, so that every sensor can be laid over the truth.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from flightlog.equipment import Equipment
from flightlog.rotations import from_angles
from flightlog.tables import Table

Floats = NDArray[np.float64]
RPM = 30.0 / np.pi


@dataclass(frozen=True, eq=False)
class Series:
    """One curve of a plot."""

    t: Floats  # (N,) [s]
    values: Floats  # (N,)


class Attitude:
    """The attitude at any time, from the nearest row of a table with roll, pitch, heading."""

    def __init__(self, table: Table) -> None:
        """`table`: truth/state or measured/estimate; rows without an attitude are left out."""
        angles = table.stack("roll", "pitch", "heading")
        good = np.isfinite(angles).all(axis=1)
        self.t = table["t"][good]
        self.angles = angles[good]

    def at(self, t: Floats) -> Rotation:
        """Rotations body to world at times (N,); level and north-up where no attitude is known."""
        if not len(self.t):
            return Rotation.identity(len(t))
        return from_angles(*self.angles[_nearest(self.t, t)].T)


def heights(
    measured: Mapping[str, Table], truth: Mapping[str, Table], equipment: Equipment | None
) -> dict[str, Series]:
    """Height of the body origin [m] above the pad as truth, fusion and each sensor have it.

    Args:
        measured: tables by topic.
        truth: tables by topic; may be empty.
        equipment: where the sensors sit; None: all at the body origin, the pad's camera looking straight down.
    """
    found: dict[str, Series] = {}
    if "state" in truth:
        found["truth"] = Series(truth["state"]["t"], truth["state"]["u"])
    if "estimate" in measured:
        found["fusion"] = Series(measured["estimate"]["t"], measured["estimate"]["u"])
    source = measured.get("estimate") or truth.get("state")
    attitude = Attitude(source) if source is not None else None
    if "baro" in measured:
        found["baro"] = Series(measured["baro"]["t"], measured["baro"]["altitude"])
    if "gps" in measured:
        table = measured["gps"]
        lever = _up(np.broadcast_to(_position(equipment, "gps"), (len(table), 3)), table["t"], attitude)
        found["gps"] = _valid(table, table["u"] - lever)
    if "sonar" in measured:
        table = measured["sonar"]
        # the beam points along body -z from where the device sits
        echo = _position(equipment, "sonar") + table["range"][:, None] * np.array([0.0, 0.0, -1.0])
        found["sonar"] = _valid(table, -_up(echo, table["t"], attitude))
    if "pad" in measured:
        table = measured["pad"]
        position, axes = np.zeros(3), np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        if equipment is not None and "down" in equipment.cameras:
            position, axes = equipment.cameras["down"].mount.position, equipment.cameras["down"].mount.axes
        mark = position + table.stack("x", "y", "z") @ axes.T
        found["vision"] = Series(table["t"], -_up(mark, table["t"], attitude))
    return found


def height_errors(found: Mapping[str, Series]) -> dict[str, Series]:
    """Each height less the truth at its time of validity [m]; none without truth."""
    if "truth" not in found or not len(found["truth"].t):
        return {}
    truth = found["truth"]
    return {
        name: Series(series.t, series.values - np.interp(series.t, truth.t, truth.values))
        for name, series in found.items()
        if name != "truth"
    }


def path(table: Table, rate: float) -> tuple[Floats, Floats]:
    """Times (N,) and positions (N, 3) [m] ENU of a table with e, n, u, thinned to `rate` [Hz], finite rows only."""
    points = table.stack("e", "n", "u")
    good = np.flatnonzero(np.isfinite(points).all(axis=1))
    t = table["t"][good]
    chosen = good[thin(t, rate)]
    return table["t"][chosen], points[chosen]


def thin(t: Floats, rate: float) -> NDArray[np.intp]:
    """Rows of sorted times (N,) that leave at most about `rate` a second: the first of each tick."""
    if not len(t):
        return np.zeros(0, np.intp)
    # the small shift keeps rows that lie on a tick, give or take rounding, in that tick
    return np.unique(np.floor((t - t[0]) * rate + 1e-6), return_index=True)[1]


def _up(vectors: Floats, t: Floats, attitude: Attitude | None) -> Floats:
    """The world's vertical component (N,) of vectors (N, 3) in body axes."""
    if attitude is None or not len(t):
        return np.asarray(vectors[:, 2], float)
    return np.asarray(attitude.at(t).apply(np.array(vectors))[:, 2], float)


def _valid(table: Table, values: Floats) -> Series:
    good = np.asarray(table["valid"] != 0) & np.isfinite(values) if "valid" in table else np.isfinite(values)
    return Series(table["t"][good], values[good])


def _position(equipment: Equipment | None, sensor: str) -> Floats:
    if equipment is None or sensor not in equipment.sensors:
        return np.zeros(3)
    return np.asarray(equipment.sensors[sensor].position, float)


def _nearest(known: Floats, t: Floats) -> NDArray[np.intp]:
    right = np.clip(np.searchsorted(known, t), 1, max(len(known) - 1, 1))
    left = right - 1
    right = np.minimum(right, len(known) - 1)
    return np.where(t - known[left] <= known[right] - t, left, right)
