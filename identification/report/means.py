"""Means of what is left over what it may depend on, and how far they scatter where nothing is wrong."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BINS = 12
LEAST = 8  # rows in a bin
MEMORY = 5.0  # [s] of gusts
SLOW = (0.2, 1.0)  # [s] lags at which only what remembers still shows
SIGMAS = 3.0  # of the band
NEARER = 0.7  # of a mean that departs, to which the cause must bring it


@dataclass(frozen=True, eq=False)
class Course:
    """Means of one channel over one driver, all flights together."""

    channel: str
    unit: str  # 'std': standard deviations of the innovation
    driver: str
    label: str  # of the driver, with its unit
    middles: Floats  # (B,)
    before: Floats  # (B,)
    after: Floats  # (B,)
    std: Floats  # (B,) of a mean where nothing is wrong
    told: float  # of what the causes change, the share of the variance that the driver tells

    @property
    def band(self) -> Floats:
        """(B,) within which a mean lies where nothing is wrong."""
        return SIGMAS * self.std

    @property
    def departs(self) -> bool:
        """Whether a mean before lies outside the band and comes clearly nearer to nothing."""
        was, now = np.abs(self.before), np.abs(self.after)
        return bool(np.any((was > self.band) & (now < NEARER * was)))

    @property
    def taken(self) -> float:
        """[nats] that the causes take out of the means."""
        return float(0.5 * np.sum((self.before**2 - self.after**2) / self.std**2))


@dataclass(frozen=True, eq=False)
class Bins:
    """Where the rows of all flights lie along one driver."""

    which: Sequence[Ints]  # by flight, (N,); -1: nowhere
    middles: Floats  # (B,)
    count: Ints  # (B,)

    def means(self, values: Sequence[Floats]) -> Floats:
        """(B,) of values by flight, (N,) each."""
        total = np.zeros(len(self.count))
        for which, part in zip(self.which, values, strict=True):
            at = which >= 0
            total += np.bincount(which[at], part[at], len(self.count))
        return np.asarray(total / self.count)

    def tells(self, values: Sequence[Floats]) -> float:
        """Share of the variance of values, by flight (N,) each, that is one between bins."""
        used = np.concatenate([part[which >= 0] for which, part in zip(self.which, values, strict=True)])
        whole = float(np.sum((used - used.mean()) ** 2))
        between = float(np.sum(self.count * (self.means(values) - used.mean()) ** 2))
        return between / whole if whole > 0.0 else 0.0

    def scatter(self, values: Sequence[Floats], step: float) -> Floats:
        """(B,) standard deviation of such means, values being noise of which a part remembers for MEMORY.

        The rows of a flight are `step` seconds apart.
        """
        slow, quick = parts(values, step)
        keep = float(np.exp(-step / MEMORY))
        alike = np.zeros(len(self.count))
        for which in self.which:
            inside = (which[:, None] == np.arange(len(self.count))).astype(float)
            alike += (inside * (2.0 * lfilter([1.0], [1.0, -keep], inside, axis=0) - 1.0)).sum(axis=0)
        return np.sqrt(quick / self.count + slow * alike / self.count**2)


def parts(values: Sequence[Floats], step: float) -> tuple[float, float]:
    """Variance of what remembers for MEMORY and of what does not remember; NaN: not measured."""
    square = float(np.nanmean(np.concatenate(values) ** 2))
    first, last = (max(1, round(lag / step)) for lag in SLOW)
    found = []
    for lag in range(first, last + 1):
        products = np.concatenate([v[lag:] * v[:-lag] for v in values if len(v) > lag] or [np.zeros(1)])
        if np.isfinite(products).any():
            found.append(float(np.nanmean(products)) * np.exp(lag * step / MEMORY))
    slow = float(np.clip(np.mean(found) if found else 0.0, 0.0, square))
    return slow, square - slow


def binned(x: Sequence[Floats], good: Sequence[NDArray[np.bool_]], near: float | None = None) -> Bins | None:
    """Cut a driver's range; x, good by flight, (N,) each; near: see `drivers.Driver`. None where it hardly varies.

    Bins are neither all of one width nor all of one count: half of each, so that neither a short passage at an end of
    the range nor a long stay at one place is one bin. Those with too few rows go to their neighbour.
    """
    used = np.concatenate([part[g] for part, g in zip(x, good, strict=True)])
    if len(used) < 4 * LEAST or not np.ptp(used) > 1e-6 * max(1.0, float(np.abs(used).max())):
        return None
    grid = np.quantile(used, np.linspace(0.0, 1.0, 401))
    scale = grid if near is None else np.log(near + np.maximum(grid, 0.0))
    share = np.linspace(0.0, 1.0, 401) + (scale - scale[0]) / (scale[-1] - scale[0])
    edges = np.interp(np.linspace(0.0, 2.0, BINS + 1), share, grid)
    edges = _merged(np.unique(edges), used)
    if len(edges) < 4:
        return None
    which = []
    for part, g in zip(x, good, strict=True):
        place = np.clip(np.searchsorted(edges, part, side="right") - 1, 0, len(edges) - 2)
        which.append(np.where(g, place, -1))
    count = np.bincount(np.concatenate([w[w >= 0] for w in which]), minlength=len(edges) - 1)
    bins = Bins(which, np.zeros(0), count)
    return Bins(which, bins.means([np.nan_to_num(part) for part in x]), count)


def _merged(edges: Floats, values: Floats) -> Floats:
    """Edges without those that leave fewer than LEAST values before them."""
    kept, ordered = [edges[0]], np.sort(values)
    for edge in edges[1:-1]:
        inside = np.searchsorted(ordered, edge) - np.searchsorted(ordered, kept[-1])
        behind = len(ordered) - np.searchsorted(ordered, edge)
        if inside >= LEAST and behind >= LEAST:
            kept.append(edge)
    return np.array([*kept, edges[-1]])


def course(
    channel: str, unit: str, driver: str, label: str, bins: Bins, before: Sequence[Floats], after: Sequence[Floats],
    std: Floats,
) -> Course:  # fmt: skip
    """Means of what is left before and after, by flight (N,) each."""
    change = [a - b for a, b in zip(before, after, strict=True)]
    return Course(
        channel, unit, driver, label, bins.middles, bins.means(before), bins.means(after), std, bins.tells(change)
    )
