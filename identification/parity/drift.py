"""Slow errors of heights: which sensor walked away, by the evidence of a filter in which each may.

The aircraft's height moves freely; every sensor shows it with an offset, a slow error (Gauss-Markov) as large as is
usual for its kind, white noise taken from the log, and the everyday errors that a flight brings: a receiver is late, a
barometer feels the airspeed and the rotors' wash. A cause lets one sensor's slow error walk away besides, at a rate
that itself changes slowly.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.parity.series import Floats, Heights, Series

STEP = 0.5  # [s] of a node at least
NODES = 2400  # at most
RESTLESS = 4.0  # [m/s^1.5] random walk of the climb rate
OFFSET = 100.0  # [m] of every sensor's zero
TOGETHER = 1.0, 60.0  # [m], [s] slow error common to all barometers: weather, the air in the hull
APART = 1.0, 60.0  # [m], [s] of each of them
WANDER = 1.5, 100.0  # [m], [s] least slow error of a receiver's height
PER_HDOP = (
    2.4  # [m] the same for each unit of the horizontal dilution: vertical is 1.6 times as uncertain, 1.5 m a range
)
UNKNOWN_HDOP = 1.5
REFERENCE = 0.05, 100.0  # [m], [s]
DOPPLER = 0.05, 30.0  # [m/s], [s] slow error of a receiver's climb rate
DELAY = 0.7  # [s] by which a receiver's height may lag
PORT = 0.5  # [1] share of the dynamic pressure that a barometer feels
WASH = 4.0  # [m] a barometer's error from no to full throttle
FLOORS: Mapping[str, float] = {"baro": 0.25, "gps": 0.2, "climb": 0.1, "reference": 0.01}
RATES = (0.1, 0.3, 1.0)  # [m/s] of a sensor that walks away, standard deviation
SMOOTH: Mapping[str, float] = {"baro": 0.03, "gps": 0.04}  # [m/s] the same of any day; a receiver's for hdop 1
LASTING = 15.0  # [s] for which it keeps its rate
ODD = 5.0  # standard deviations beyond which a sample is left out, under every hypothesis alike
REST = 2.0, 0.05  # [s] and throttle [1]: standing on the ground before and after
LEVEL = 0.4, 0.05  # [m] and share of the way: how far the ground there differs


@dataclass(frozen=True, eq=False)
class Problem:
    """Measurements on nodes: value (N, M) with NaN where there is none, their rows of H, and noise."""

    t: Floats  # (N,)
    names: tuple[str, ...]  # (M,) channels
    values: Floats  # (N, M)
    rows: Floats  # (N, M, S)
    stds: Floats  # (M,)
    step: float
    slow: Mapping[str, int]  # sensor -> state of its slow error; the next is the rate of its walk
    sizes: Floats  # (S,) stationary std of slow errors; of constants their prior's
    taus: Floats  # (S,) [s]; inf: constant


@dataclass(frozen=True, eq=False)
class Walk:
    """Smoothed slow error of one sensor."""

    t: Floats
    error: Floats  # [m]
    std: Floats  # [m]


def pose(heights: Heights) -> Problem | None:
    """The filter's problem; None where fewer than two heights overlap."""
    levels = {**{k: ("baro", s) for k, s in heights.baro.items()}, **{k: ("gps", s) for k, s in heights.gps.items()}}
    if heights.reference is not None:
        levels["reference"] = ("reference", heights.reference)
    if len(levels) < 2:
        return None
    begin = min(float(s.t[0]) for _, s in levels.values())
    end = max(float(s.t[-1]) for _, s in levels.values())
    step = max(STEP, (end - begin) / NODES)
    t = np.arange(begin, end, step) + 0.5 * step
    motion = _climb_rate(heights, t)
    speed = np.nan_to_num(heights.speed.at(t)) if heights.speed is not None else np.zeros(len(t))
    throttle = np.nan_to_num(heights.throttle.at(t)) if heights.throttle is not None else np.zeros(len(t))
    states: list[tuple[float, float]] = [(OFFSET, np.inf), (5.0, np.inf)]  # height, climb rate

    def state(size: float, tau: float) -> int:
        states.append((size, tau))
        return len(states) - 1

    def wander(size: float, tau: float, smooth: float = 0.0) -> int:
        number = state(size, tau)
        state(smooth, LASTING)
        return number

    slow: dict[str, int] = {}
    port = wash = -1
    if heights.baro:
        slow["baro"] = wander(*TOGETHER, SMOOTH["baro"])
        port, wash = state(PORT, np.inf), state(WASH, np.inf)
    columns: list[tuple[str, Floats, dict[int, Floats | float], float]] = []
    for name, (kind, series) in levels.items():
        value, rate = _binned(series, t, step)
        if np.count_nonzero(np.isfinite(value)) < 10:
            continue
        row: dict[int, Floats | float] = {0: 1.0, state(OFFSET, np.inf): 1.0}
        if kind == "baro":
            slow[name if len(heights.baro) > 1 else "baro_own"] = own = wander(*APART, 0.5 * SMOOTH["baro"])
            row |= {own: 1.0, slow["baro"]: 1.0, port: speed**2 / 19.6, wash: throttle}
            if len(heights.baro) > 1:  # each sits in air of its own
                row |= {state(0.5 * PORT, np.inf): speed**2 / 19.6, state(0.5 * WASH, np.inf): throttle}
        elif kind == "gps":
            hdop = heights.hdop if np.isfinite(heights.hdop) else UNKNOWN_HDOP
            slow[name] = wander(max(WANDER[0], PER_HDOP * hdop), WANDER[1], SMOOTH["gps"] * max(hdop, 0.5))
            row |= {slow[name]: 1.0, state(DELAY, np.inf): -motion}
        else:
            slow[name] = wander(*REFERENCE)
            row |= {slow[name]: 1.0}
        columns.append((name, value, row, max(FLOORS[kind], rate)))
    for name, series in heights.climb.items():
        value, rate = _binned(series, t, step)
        slow[f"{name}.vu"] = own = wander(*DOPPLER)
        columns.append((f"{name}.vu", value, {1: 1.0, own: 1.0}, max(FLOORS["climb"], rate)))
    if (ground := _ground(heights, t)) is not None:
        value, std = ground
        columns.append(("ground", value, {0: 1.0}, std))
    if len(columns) < 2:
        return None
    rows = np.zeros((len(t), len(columns), len(states)))
    for m, (_, _, row, _) in enumerate(columns):
        for s, by in row.items():
            rows[:, m, s] = by
    sizes, taus = (np.array(part) for part in zip(*states, strict=True))
    values = np.column_stack([value for _, value, _, _ in columns])
    return Problem(t, tuple(c[0] for c in columns), values, rows, np.array([c[3] for c in columns]), step, slow,
                   sizes, taus)  # fmt: skip


def _binned(series: Series, t: Floats, step: float) -> tuple[Floats, float]:
    """(N,) medians of a channel about each node, less its overall median; and the noise of one."""
    node = np.floor((series.t - (t[0] - 0.5 * step)) / step).astype(int)
    inside = (node >= 0) & (node < len(t))
    order = np.lexsort((series.value[inside], node[inside]))
    node, sorted_values = node[inside][order], series.value[inside][order]
    found = np.full(len(t), np.nan)
    which, first, count = np.unique(node, return_index=True, return_counts=True)
    found[which] = 0.5 * (sorted_values[first + (count - 1) // 2] + sorted_values[first + count // 2])
    bends = found[2:] - 2.0 * found[1:-1] + found[:-2]
    bends = bends[np.isfinite(bends)]
    noise = 1.48 * float(np.median(np.abs(bends))) / np.sqrt(6.0) if len(bends) else 0.0
    # a velocity's own zero means something; a height's does not
    return found - (0.0 if series.name.endswith(".vu") else np.nanmedian(found)), noise


def _climb_rate(heights: Heights, t: Floats) -> Floats:
    """(N,) [m/s] about how fast the aircraft climbs: to tell what a late receiver shows."""
    if heights.climb:
        return np.nan_to_num(next(iter(heights.climb.values())).at(t))
    source = next(iter(heights.gps.values()), None) or next(iter(heights.levels.values()))
    level = source.at(t)
    good = np.isfinite(level)
    if np.count_nonzero(good) < 3:
        return np.zeros(len(t))
    return np.where(good, np.gradient(np.interp(t, t[good], level[good]), t), 0.0)


def _ground(heights: Heights, t: Floats) -> tuple[Floats, float] | None:
    """Height zero where the aircraft stands with its throttle closed before and after a flight; how level that is."""
    if heights.throttle is None or not heights.throttle.name.endswith("throttle"):
        return None
    throttle = heights.throttle.at(t)
    up = np.flatnonzero(throttle > 3.0 * REST[1])
    if not len(up):
        return None
    closed = np.nan_to_num(throttle, nan=1.0) < REST[1]
    still = np.abs(_climb_rate(heights, t)) < 0.3
    at_rest = closed & still
    before, after = at_rest & (t < t[up[0]] - 0.5), at_rest & (t > t[up[-1]] + 1.5)
    least = REST[0] / (t[1] - t[0])
    if np.count_nonzero(before) < least or np.count_nonzero(after) < least:
        return None
    value = np.full(len(t), np.nan)
    # once before and once after: it is one statement about the ground
    value[np.flatnonzero(before)[-1]] = value[np.flatnonzero(after)[0]] = 0.0
    way = 100.0
    if heights.place is not None:
        ends = t[[np.flatnonzero(before)[-1], np.flatnonzero(after)[0]]]
        way = float(np.nan_to_num(np.hypot(*(np.diff(axis.at(ends))[0] for axis in heights.place)), nan=way))
    return value, LEVEL[0] + LEVEL[1] * way


def plain(problem: Problem) -> Problem:
    """The problem without the samples that a filter in which nothing walks away cannot believe."""
    odd = np.zeros(problem.values.shape, bool)
    _filter(problem, {}, odd=odd)
    return replace(problem, values=np.where(odd, np.nan, problem.values))


def evidence(problem: Problem, rates: Mapping[str, float] | None = None) -> float:
    """Log evidence with some sensors walking away at rates of these standard deviations [m/s]."""
    return _filter(problem, rates or {})[0]


def walk(problem: Problem, sensor: str, rates: Mapping[str, float]) -> Walk:
    """The slow error of a sensor since its start, smoothed (Rauch, Tung, Striebel)."""
    begun = problem.slow[sensor]  # at nothing: its level is an offset
    _, means, covariances, ahead_means, ahead_covariances, f = _filter(problem, rates, begun)
    x, p = means[-1], covariances[-1]
    i = problem.slow[sensor]
    error, std = np.zeros(len(means)), np.zeros(len(means))
    for n in range(len(means) - 1, -1, -1):
        if n < len(means) - 1:
            # rates that are not at work have no variance
            gain = covariances[n] @ f.T @ np.linalg.pinv(ahead_covariances[n + 1], hermitian=True)
            x = means[n] + gain @ (x - ahead_means[n + 1])
            p = covariances[n] + gain @ (p - ahead_covariances[n + 1]) @ gain.T
        error[n], std[n] = x[i], np.sqrt(max(p[i, i], 0.0))
    return Walk(problem.t, error, std)


def _filter(
    problem: Problem, rates: Mapping[str, float], begun: int | None = None, odd: NDArray[np.bool_] | None = None
) -> tuple[float, Floats, Floats, Floats, Floats, Floats]:
    sizes = problem.sizes.copy()
    keep = np.where(np.isinf(problem.taus), 1.0, np.exp(-problem.step / problem.taus))
    f = np.diag(keep)
    for sensor, rate in rates.items():
        sizes[problem.slow[sensor] + 1] += rate
    for own in problem.slow.values():
        f[own, own + 1] = problem.step
    f[0, 1] = problem.step
    q = np.diag(sizes**2 * (1.0 - keep**2))
    s, dt = RESTLESS**2, problem.step
    q[:2, :2] += s * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    nodes, count = len(problem.t), len(sizes)
    x, p = np.zeros(count), np.diag(np.where(np.arange(count) == begun, 0.0, sizes) ** 2)
    means, covariances = np.empty((nodes, count)), np.empty((nodes, count, count))
    ahead_means, ahead_covariances = np.empty((nodes, count)), np.empty((nodes, count, count))
    total = 0.0
    have = np.isfinite(problem.values)
    for n in range(nodes):
        if n:
            x, p = f @ x, f @ p @ f.T + q
        ahead_means[n], ahead_covariances[n] = x, p
        for m in np.flatnonzero(have[n]):
            h = problem.rows[n, m]
            ph = p @ h
            s2 = float(h @ ph) + problem.stds[m] ** 2
            nu = float(problem.values[n, m] - h @ x)
            if odd is not None and nu * nu > ODD**2 * s2:
                odd[n, m] = True
                continue
            total -= 0.5 * (nu * nu / s2 + np.log(s2))
            x = x + ph * (nu / s2)
            p = p - np.outer(ph, ph / s2)
        means[n], covariances[n] = x, p
    return total, means, covariances, ahead_means, ahead_covariances, f


def hypotheses(problem: Problem) -> dict[str, Sequence[str]]:
    """By cause the slow errors that it may be about."""
    found: dict[str, Sequence[str]] = {}
    if baros := [name for name in problem.slow if name.startswith("baro") and name != "baro_own"]:
        found["baro_drift"] = baros
    if gps := [name for name in problem.slow if name.startswith("gps") and not name.endswith(".vu")]:
        found["gps_drift"] = gps
    return found


def witnesses(problem: Problem) -> int:
    """Channels that measure the height and carry weight."""
    return sum(name != "ground" or std < WANDER[0] for name, std in zip(problem.names, problem.stds, strict=True))
