"""Times for rows that carry none, from their place between rows that do."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LONG = 5.0  # times the usual step between known rows: the log paused there
RESET = 1.0  # [s]


class RowClock:
    """Time by a row's place in the file, between rows of known time."""

    def __init__(self, place: NDArray[np.int64], t: Floats) -> None:
        """`place` (N,), rising, and `t` (N,) [s] of the rows that carry a time; at least two of them."""
        sound = np.isfinite(t)
        self._place, self._t = place[sound].astype(float), t[sound]
        steps, rows = np.diff(self._t), np.diff(self._place)
        forward = steps > 0.0
        self._usual = float(np.median(steps[forward])) if forward.any() else 1.0
        ordinary = forward & (steps <= LONG * self._usual)
        # seconds that a row takes
        self._row = float(np.median(steps[ordinary] / rows[ordinary])) if ordinary.any() else 0.0

    def at(self, place: NDArray[np.int64]) -> tuple[Floats, int]:
        """(times (N,) [s], how many of them stand where the log paused) of rows by their place in the file.

        Between two known rows time runs evenly. Where the log paused between them, or its clock was reset, the rows
        are taken to follow the earlier one at the usual pace. So are those after the last; those before the first
        precede it so.
        """
        known, t, row = self._place, self._t, self._row
        left = np.clip(np.searchsorted(known, place, side="right") - 1, 0, len(known) - 1)
        right = np.minimum(left + 1, len(known) - 1)
        span, rows = t[right] - t[left], known[right] - known[left]
        past = place - known[left]
        paused = (span > LONG * self._usual) | (span < 0.0)
        inside = (past >= 0.0) & (rows > 0.0) & ~paused
        pace = np.where(inside, span / np.maximum(rows, 1.0), row)
        follows = paused & (past > 0.0) & (rows > 0.0)
        return t[left] + past * pace, int(np.count_nonzero(follows))
