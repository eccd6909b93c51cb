"""Whether two heights run by one clock, in one direction and unit: by their climb rates."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import correlate, correlation_lags

from flightlog.errors import UserError
from identification.parity.series import Floats, Heights, Series

GRID = 0.2  # [s]
SMOOTH = 1.0  # [s]
FARTHEST = 60.0  # [s]
USUAL = 2.5  # [s] by which a receiver or a filtered height may be late
MOVED = 4.0  # [m]
STRANGE = 0.8  # below which they are not
ALIKE = 0.85  # correlation from which on two climb rates are of one flight
STRETCH = 5.0  # [s] of climb that count as one observation
FOOT = 0.3048  # [m]
WITHIN = 0.1  # of a factor
CHOSEN = 0.01  # of the evidence is taken back for having looked at every lag


@dataclass(frozen=True)
class Late:
    """A clock that is off."""

    topic: str
    others: tuple[str, ...]  # that may be off instead, the other way
    delay: float  # [s] by which the topic's stamps are too late
    std: float
    log_bayes_factor: float


def check(name: str, heights: Heights) -> None:
    """Raise UserError where two heights are plainly of one flight but one is upside down, or in feet."""
    for a, b, one, other in _pairs(heights):
        lags, every = _correlation(one, other)
        near = every[np.abs(lags) <= USUAL]
        if -float(near.min()) > max(ALIKE, float(every.max())):
            raise UserError(
                f"{name}: {a.name} falls when {b.name} rises; both should be heights, up positive: one is likely a "
                "depth (NED), set its frame or a scale of -1 in a mapping"
            )
        slope = float(np.std(one) / np.std(other))
        for factor, wrong, right in ((1.0 / FOOT, a, b), (FOOT, b, a)):
            if float(near.max()) > 0.9 and abs(slope / factor - 1.0) < WITHIN:
                raise UserError(
                    f"{name}: {wrong.name} moves {1.0 / FOOT:.2f} times as far as {right.name}; heights are wanted "
                    'in m: it is likely in ft, declare unit = "ft" in a mapping'
                )


def strangers(heights: Heights) -> tuple[str, str] | None:
    """Two heights that do not move together at all although both move: no one flight's; None where there are none."""
    for a, b, one, other in _pairs(heights):
        lags, every = _correlation(one, other)
        if float(every[np.abs(lags) <= USUAL].max()) < STRANGE:
            return a.name, b.name
    return None


def _pairs(heights: Heights) -> Iterator[tuple[Series, Series, Floats, Floats]]:
    """Every two heights whose climb rates can be compared, and those."""
    for a, b in combinations(heights.levels.values(), 2):
        found = _rates(a, b)
        if found is not None:
            yield a, b, *found


def offset(heights: Heights) -> tuple[Late | None, Heights]:
    """The clock that is off, if one is, and the heights with it set right."""
    levels = heights.levels
    names = [name for name in levels if name.split("_")[0] != "baro"] + [n for n in levels if n.split("_")[0] == "baro"]
    pairs = {}
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            if {one, other} & set(heights.baro) != {one, other}:  # barometers of one board share its clock
                pairs[one, other] = _lag(levels[one], levels[other])
    off = {pair: found for pair, found in pairs.items() if found is not None and abs(found[0]) > USUAL}
    if not off:
        return None, heights
    votes = {name: sum(name in pair for pair in off) for name in names}
    topic = max(votes, key=lambda n: votes[n])
    mine = {pair: found for pair, found in off.items() if topic in pair}
    pair, (lag, score) = max(mine.items(), key=lambda item: item[1][1])
    delay = lag if pair[0] == topic else -lag
    others = tuple(n for n in names if n != topic and votes[n] == votes[topic])
    right = levels[topic].moved(-delay)
    put = replace(
        heights,
        baro={k: right if k == topic else s for k, s in heights.baro.items()},
        gps={k: right if k == topic else s for k, s in heights.gps.items()},
        climb={k: s.moved(-delay) if k == topic else s for k, s in heights.climb.items()},
        reference=right if topic == "reference" else heights.reference,
        speed=heights.speed and _moved(heights.speed, topic, delay),
        place=heights.place and (_moved(heights.place[0], topic, delay), _moved(heights.place[1], topic, delay)),
    )
    return Late(topic, others, delay, USUAL / 5.0, score), put


def _moved(series: Series, topic: str, delay: float) -> Series:
    return series.moved(-delay) if series.name.partition(".")[0] == topic else series


def _rates(a: Series, b: Series) -> tuple[Floats, Floats] | None:
    """Climb rates of both on one grid; None where they do not overlap or move too little to say anything."""
    first, last = max(a.t[0], b.t[0]), min(a.t[-1], b.t[-1])
    if last - first < 4.0 * STRETCH:
        return None
    grid = np.arange(first, last, GRID)
    one, two = a.at(grid), b.at(grid)
    both = np.isfinite(one) & np.isfinite(two)
    if np.count_nonzero(both) < 4.0 * STRETCH / GRID or min(_extent(one[both]), _extent(two[both])) < MOVED:
        return None
    rates = []
    for values in (one, two):
        bridged = np.interp(grid, grid[both], values[both])
        rate = np.gradient(gaussian_filter1d(bridged, SMOOTH / GRID), GRID)
        usual = 5.0 * float(np.median(np.abs(rate))) + 1.0
        rates.append(np.clip(rate, -usual, usual) * both)
    return rates[0], rates[1]


def _extent(values: Floats) -> float:
    return float(np.subtract(*np.percentile(values, [97.0, 3.0])))


def _lag(a: Series, b: Series) -> tuple[float, float] | None:
    """By how much the first comes later than the second [s], and the evidence for it over none."""
    found = _rates(a, b)
    if found is None:
        return None
    lags, every = _correlation(*found)
    usual = float(np.max(every[np.abs(lags) <= USUAL]))
    best = int(np.argmax(every))
    if every[best] < ALIKE:
        return None
    count = len(found[0]) * GRID / STRETCH
    gain = 0.5 * count * np.log((1.0 - max(usual, 0.0) ** 2) / max(1.0 - every[best] ** 2, 1e-3)) + np.log(CHOSEN)
    return (float(lags[best]), float(gain)) if gain > 0.0 else None


def _correlation(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Lags [s] of the first behind the second, and the correlation at each."""
    x, y = x - np.mean(x), y - np.mean(y)
    power = max(float(np.sqrt(np.sum(x**2) * np.sum(y**2))), 1e-12)
    every, lags = correlate(x, y) / power, correlation_lags(len(x), len(y)) * GRID
    near = np.abs(lags) <= min(FARTHEST, 0.5 * len(x) * GRID)
    return np.asarray(lags[near]), np.asarray(every[near])
