"""Counts: jumps of a barometer and echoes from nowhere, each by its own likelihood.

A jump: what stands outside the band that the other height went through about that time. Day by day a barometer is off
by a Laplacian of some decimetres (gusts, rotor wash, the ground at touchdown); a jump may be of any size up to WIDEST
and comes once in some minutes. An echo: the ranger says the ground is near while the heights say that it is far. Day by
day the ground may rise under the aircraft, by as much as a slope makes of the way flown; a false echo lies anywhere in
the ranger's reach, whatever the height.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter, minimum_filter1d

from identification.parity.series import Floats, Heights, Series

GRID = 0.1  # [s] on which heights are compared
LATE = 2.0  # [s] by which a receiver's height may lag
SLOW = 20.0  # [s] over which two heights may wander apart
BURST = 1.0  # [s] within which jumps are one
EVERYDAY = 0.5  # [m] Laplacian scale of a barometer's own short errors
LEAST_JUMP = 6.0  # of these
WIDEST = 200.0  # [m]
RARE = 0.02  # chance of a jump in a stretch of SLOW
SUDDEN = 0.35  # [s] in which a jump rises
BLOCK = 1.0  # [s]
SLOPE = 0.5  # of the ground, scale
ROUGH = 0.5  # [m] of the ground and of both heights, scale, from block to block
FAR = 3.0, 0.1  # [m] and share of the height, by which an echo must be too near


@dataclass(frozen=True, eq=False)
class Found:
    """Events of one kind: the rows at fault, and the evidence for the cause over an everyday sensor."""

    log_bayes_factor: float
    count: int
    size: float  # [m] the largest, with its sign
    first: float  # [s] in the log's clock
    share: float  # of the rows that could have shown it
    rows: NDArray[np.bool_]


def glitches(baro: Series, others: list[Series], *, everyday: float = EVERYDAY, late: float = LATE) -> Found:
    """Jumps of a barometer's height that no other height makes.

    everyday: scale [m] of its own short errors. late: [s] by which the others may lag.
    """
    nothing = Found(0.0, 0, 0.0, float("nan"), 0.0, np.zeros(len(baro.t), bool))
    outside = _outside(baro, others, late)
    if not np.isfinite(outside).any():
        return nothing
    scale = max(everyday, 1.5 * float(np.nanmedian(np.abs(outside))))
    hot = np.flatnonzero(np.abs(np.nan_to_num(outside)) > LEAST_JUMP * everyday)
    if not len(hot):
        return nothing
    groups = np.split(hot, np.flatnonzero(np.diff(baro.t[hot]) > BURST) + 1)
    rows = np.zeros(len(baro.t), bool)
    evidence, sizes, begins = 0.0, [], []
    for group in groups:
        if not _sudden(baro, group, outside):
            continue
        worst = group[np.argmax(np.abs(outside[group]))]
        size = float(outside[worst])
        rows[group] = True
        gain = abs(size) / scale + np.log(scale / WIDEST) + np.log(RARE)
        if gain > 0.0:
            evidence += float(gain)
            sizes.append(size)
            begins.append(float(baro.t[group[0]]))
    if not sizes:
        return Found(0.0, 0, 0.0, float("nan"), 0.0, rows)
    largest = sizes[int(np.argmax(np.abs(sizes)))]
    return Found(evidence, len(sizes), largest, begins[0], float(np.mean(rows)), rows)


def _outside(baro: Series, others: list[Series], late: float) -> Floats:
    """(N,) [m] by which the barometer is outside what the nearest of the others went through; its own median alone."""
    found = []
    for other in others:
        grid = np.arange(other.t[0], other.t[-1], GRID)
        level = other.at(grid)
        apart = _running_median(baro.at(grid) - level)
        width = 2 * round(late / GRID) + 1
        low = minimum_filter1d(np.where(np.isnan(level), np.inf, level), width) + apart
        high = maximum_filter1d(np.where(np.isnan(level), -np.inf, level), width) + apart
        below = np.interp(baro.t, grid, np.where(np.isfinite(low), low, np.nan), left=np.nan, right=np.nan)
        above = np.interp(baro.t, grid, np.where(np.isfinite(high), high, np.nan), left=np.nan, right=np.nan)
        excess = np.where(baro.value > above, baro.value - above, np.minimum(baro.value - below, 0.0))
        found.append(np.where(np.isfinite(below + above), excess, np.nan))
    usual = max(1e-3, float(np.median(np.diff(baro.t))))
    own = baro.value - median_filter(baro.value, size=2 * max(1, round(LATE / usual)) + 1, mode="nearest")
    if not found:
        # by itself: only what it takes back within the window
        return np.asarray(np.sign(own) * np.maximum(np.abs(own) - 2.0 * EVERYDAY, 0.0))
    stack = np.array(found)
    nearest = np.nanargmin(np.where(np.isnan(stack), np.inf, np.abs(stack)), axis=0)
    return np.asarray(np.take_along_axis(stack, nearest[None], axis=0)[0])


def _running_median(values: Floats) -> Floats:
    """Over SLOW; what is missing is bridged."""
    good = np.isfinite(values)
    if not good.any():
        return np.full(len(values), np.nan)
    at = np.arange(len(values))
    bridged = np.interp(at, at[good], values[good])
    coarse = 10  # medians of every tenth suffice
    slow = median_filter(bridged[::coarse], size=2 * round(SLOW / (2 * GRID * coarse)) + 1, mode="nearest")
    return np.interp(at, at[::coarse], slow)


def _sudden(baro: Series, group: NDArray[np.int64], outside: Floats) -> bool:
    """Whether the barometer itself leapt: by half of the size within a few samples."""
    first, last = max(0, group[0] - 5), min(len(baro.t), group[-1] + 6)
    t, value = baro.t[first:last], baro.value[first:last]
    size = float(np.max(np.abs(outside[group])))
    usual = float(np.median(np.diff(baro.t)))
    reach = max(1, round(SUDDEN / max(usual, 1e-3)))
    steps = [np.abs(value[n:] - value[:-n])[t[n:] - t[:-n] <= max(SUDDEN, 1.5 * usual)] for n in range(1, reach + 1)
             if n < len(t)]  # fmt: skip
    return max((float(s.max()) for s in steps if len(s)), default=0.0) > 0.5 * size


def false_echoes(heights: Heights) -> Found:
    """Echoes that the heights and the way flown over the ground forbid."""
    sonar = heights.sonar
    nothing = Found(0.0, 0, 0.0, float("nan"), 0.0, np.zeros(0 if sonar is None else len(sonar.t), bool))
    levels = list(heights.levels.values())
    if sonar is None or not levels:
        return nothing
    reach = float(np.max(sonar.value))
    start = max(float(s.t[0]) for s in (*levels, sonar))
    above = np.array([s.at(sonar.t) - _ground(s, start) for s in levels])
    known = np.isfinite(above).all(axis=0)
    height = np.where(known, np.min(np.where(known, above, 0.0), axis=0), np.nan)
    margin = FAR[0] * (1.0 if len(levels) > 1 else 2.0) + FAR[1] * np.maximum(height, 0.0)
    could = known & (height > margin)
    rows = could & (sonar.value < height - margin) & (sonar.value < 0.9 * reach)
    if np.count_nonzero(rows) < 5:
        return Found(0.0, 0, 0.0, float("nan"), 0.0, rows)
    block = np.floor((sonar.t - sonar.t[0]) / BLOCK).astype(int)
    numbers = np.unique(block[rows])
    middle = np.array([np.median(sonar.value[rows & (block == b)]) for b in numbers])
    level = np.array([np.median(height[rows & (block == b)]) for b in numbers])
    jump = np.array([np.ptp(sonar.value[rows & (block == b)]) for b in numbers])
    follows = np.diff(numbers) <= 2
    fast = np.zeros(len(numbers)) if heights.speed is None else np.nan_to_num(
        heights.speed.at(sonar.t[0] + BLOCK * (numbers + 0.5)), nan=20.0)  # fmt: skip
    if heights.speed is None:
        fast[:] = 20.0  # unknown: the ground may be anything
    risen = np.abs(np.diff(level - middle)) + 0.5 * (jump[1:] + jump[:-1])
    scale = ROUGH + SLOPE * BLOCK * np.diff(numbers) * 0.5 * (fast[1:] + fast[:-1])
    ground = -np.log(2.0 * scale) - risen / scale
    gain = (-np.log(max(reach, 1.0)) - ground)[follows]
    share = float(np.count_nonzero(rows) / np.count_nonzero(could))
    worst = int(np.argmax(np.where(rows, height - sonar.value, -np.inf)))
    return Found(
        float(gain.sum() + np.log(0.05)) if len(gain) else 0.0, int(np.count_nonzero(rows)),
        float(sonar.value[worst] - height[worst]), float(sonar.t[np.flatnonzero(rows)[0]]), share, rows,
    )  # fmt: skip


def _ground(series: Series, start: float) -> float:
    """[m] what a height said when the log began; a barometer's own zero is the ground already."""
    first = series.value[(series.t >= start) & (series.t <= start + 3.0)]
    begun = float(np.median(first)) if len(first) else 0.0
    return min(begun, 0.0) if series.name.startswith("baro") else begun
