"""The quick motion about the balance, where an inertial sensor saw it: it tells how late the rotors follow.

Commands answer what the sensor saw, its noise included, so the model is judged by innovations: what is left of the
accelerations is whitened by its own past (a long autoregression), and a command is known before what it causes. Beside
lag and delay everything is free that could be taken for them: every rotor's slope, the inertia, an offset and a drift.

Whoever flies by better sensors than those that were logged answers gusts before the log shows them. Where most of what
the commands do is such an answer, lag and delay come out wrong, by up to 33 and 12 ms in simulated hovers (more where
the control hardly damps); doublets tell them to a millisecond. So a flight is judged where gusts make a small share of
the moments only, and leaves lag and delay open, the more the larger that share.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightlog.tables import Table
from identification.multirotor import noise as nz
from identification.multirotor.flight import IMU, Flight, on
from identification.stack import Rows
from sim.multirotor.file import Multirotor
from sim.multirotor.model import answer

Floats = NDArray[np.float64]

TAU, DELAY = "terms.motor.tau", "terms.motor.delay"
KEYS = TAU, DELAY
SEEN = 2, 3, 4, 5  # channels: along the rotors' axis and all moments
STEP = 0.01  # [s]
ORDER = 16  # steps of the autoregression
ROUNDS = 3  # of the fit of noise and numbers
SLOPE = 0.15  # of a rotor's thrust about the hover, and of the inertia
ANYWHERE = 3.0  # times the spread of what was measured: offset and drift
FREE = 0.05  # [s] of lag and delay while the noise is fitted
STALE = 0.003  # [s] from where slopes were taken, beyond which they are taken anew
NUDGE = 0.005  # [s] for a derivative
SLOW = 10  # steps that are averaged to compare gusts with commands
# [s] by which lag and delay are open on a flight: at least, and times a power of the share of gusts over commands
OPEN = {TAU: (0.01, 0.5), DELAY: (0.003, 0.3)}
POWER = 1.5
QUIET = 0.07  # of that share, up to which a flight is judged
STAMPED = 0.3  # of a step between logged commands, by which their stamps are uncertain: when in it they were sent


@dataclass(frozen=True, eq=False)
class Quick:
    """One flight: C channels, B steps in the air."""

    flight: Flight
    block: int  # samples of the flight's inputs that are a step
    first: NDArray[np.int64]  # (B,) sample at which each step begins
    spans: Sequence[tuple[int, int]]  # first step of each stretch, and the one behind its last
    t: Floats  # (B,) [s]
    measured: Floats  # (C, B)
    local: Floats  # (L, C, B) of what is free beside
    local_std: Floats  # (L,)

    def expected(self, craft: Multirotor, changes: Mapping[str, float]) -> Floats:
        """What the model answers (C, B)."""
        samples = answer(craft, craft.values(changes), self.flight.inputs)[:, SEEN]
        return np.asarray(samples[self.first[:, None] + np.arange(self.block)].mean(axis=1).T)


def prepare(flight: Flight, tables: Mapping[str, Table], craft: Multirotor) -> Quick:
    """The quick motion of a flight that has an inertial sensor."""
    inputs = flight.inputs
    block = max(round(STEP / inputs.step), 1)
    length = block * inputs.step
    table = tables["imu"]
    grid: Floats = flight.begins + inputs.step * np.arange(len(inputs.commands), dtype=float)
    imu = [on(grid, np.asarray(table["t"], float), np.asarray(table[name], float)) for name in IMU]
    first: list[int] = []
    spans = []
    for a, b in flight.spans:
        begin, end = int(flight.first[a]), int(flight.first[b - 1]) + flight.per_node
        count = (min(end, len(grid) - 1) - begin) // block
        spans.append((len(first), len(first) + count))
        first += [begin + i * block for i in range(count)]
    at = np.array(first)
    measured = np.array([
        imu[2][at[:, None] + np.arange(block)].mean(axis=1),
        *((rate[np.minimum(at + block, len(grid) - 1)] - rate[at]) / length for rate in imu[3:]),
    ])  # fmt: skip
    bare = Quick(
        flight, block, at, spans, grid[at] + 0.5 * length, measured, np.zeros((0, *measured.shape)), np.zeros(0)
    )
    local, std = _beside(bare, craft)
    return Quick(flight, block, at, spans, bare.t, measured, local, std)


def _beside(item: Quick, craft: Multirotor) -> tuple[Floats, Floats]:
    """What is free beside lag and delay (L, C, B), with its standard deviations (L,)."""
    base = item.expected(craft, {})
    columns, std = [], []
    for key in [f"rotors.{i}.thrust_scale" for i in range(craft.rotors)]:
        columns.append((item.expected(craft, {key: craft.numbers[key].value + SLOPE}) - base) / SLOPE)
        std.append(SLOPE)
    for c in range(1, len(SEEN)):
        columns.append(np.where(np.arange(len(SEEN))[:, None] == c, base, 0.0))
        std.append(SLOPE)
    columns = [column - column.mean(axis=1, keepdims=True) for column in columns]
    for c in range(len(SEEN)):
        size = ANYWHERE * float(np.std(item.measured[c] - base[c]) + abs(np.mean(item.measured[c] - base[c])))
        for course in (np.ones(len(item.t)), np.interp(item.t, item.t[[0, -1]], [-1.0, 1.0])):
            columns.append(np.where(np.arange(len(SEEN))[:, None] == c, course, 0.0))
            std.append(size)
    return np.array(columns), np.array(std)


class Moving:
    """The quick motion of all flights, with its noise."""

    def __init__(self, items: Sequence[Quick], craft: Multirotor, like: "Moving | None" = None) -> None:
        """Fit the noise, unless it is to be `like` another's."""
        self.items = items
        self._craft = craft
        self._slopes: list[dict[str, Floats]] = [self.slopes(i, {}) for i in range(len(items))]
        usual = craft.values()
        self._about = [np.array([usual[key] for key in KEYS]) for _ in items]
        self._whitened: list[Floats | None] = [None for _ in items]
        self.noise: Sequence[nz.Autoregression] = like.noise if like is not None else self._fit()
        self._shares = [self._answered(i) for i in range(len(items))]

    def slopes(self, flight: int, changes: Mapping[str, float]) -> dict[str, Floats]:
        """What a second more of lag and delay does (C, B), about some numbers."""
        item, values = self.items[flight], self._craft.values(changes)
        base = item.expected(self._craft, values)
        return {key: (item.expected(self._craft, values | {key: values[key] + NUDGE}) - base) / NUDGE for key in KEYS}

    def rows(self, flight: int, changes: Mapping[str, float], fresh: bool, keys: Sequence[str]) -> Rows:
        """Whitened rows, none of a flight that is not judged; numbers other than lag and delay do nothing here."""
        item = self.items[flight]
        if self._shares[flight] > QUIET:
            none = np.zeros(0)
            return Rows(none, dict.fromkeys(keys, none), np.zeros((0, 0)), none, np.zeros(0, np.int64), none)
        own = {key: value for key, value in changes.items() if key in KEYS}
        values = self._craft.values(own)
        here = np.array([values[key] for key in KEYS])
        if fresh or np.abs(here - self._about[flight]).max() > STALE:
            self._slopes[flight], self._about[flight] = self.slopes(flight, own), here
            self._whitened[flight] = None
        left = item.measured - item.expected(self._craft, own)
        local = self._columns(flight)
        signatures = dict(zip(KEYS, local[:, -len(KEYS) :].T.copy(), strict=True))
        nothing = np.zeros(left.size)
        return Rows(
            residual=self._white(item, left[..., None])[:, 0],
            signatures={key: signatures.get(key, nothing) for key in keys},
            local=local,
            local_std=np.r_[item.local_std, self._open(flight)],
            channel=np.repeat(SEEN, len(item.t)),
            t=np.tile(item.t, len(SEEN)),
        )

    @property
    def tells(self) -> bool:
        """Whether any flight is judged."""
        return any(share <= QUIET for share in self._shares)

    def _answered(self, flight: int) -> float:
        """Share of the moments about the level axes that gusts make, over what commands make."""
        item = self.items[flight]
        usual = item.expected(self._craft, {})

        def power(parts: Floats) -> Floats:
            whole = parts[1:3, : parts.shape[1] // SLOW * SLOW]
            return np.asarray(whole.reshape(2, -1, SLOW).mean(axis=2).var(axis=1))

        return float(np.mean(np.minimum(power(self._without(flight)) / np.maximum(power(usual), 1e-12), 1.0)))

    def _open(self, flight: int) -> Floats:
        """(2,) [s] by which a flight leaves lag and delay open."""
        grown = self._shares[flight] ** POWER
        return np.array([max(least, grown * most) for least, most in (OPEN[key] for key in KEYS)])

    def _columns(self, flight: int) -> Floats:
        """(R, L) whitened: what is free beside, lag and delay; as long as slopes and noise are the same."""
        known = self._whitened[flight]
        if known is None:
            item, slopes = self.items[flight], self._slopes[flight]
            columns = np.concatenate([item.local, np.array([slopes[key] for key in KEYS])])
            known = self._whitened[flight] = self._white(item, np.moveaxis(columns, 0, -1))
        return known

    def _white(self, item: Quick, parts: Floats) -> Floats:
        """(C, B, L) -> (R, L)."""
        return np.concatenate([self.noise[c].whiten(part, item.spans) for c, part in enumerate(parts)])

    def _fit(self) -> Sequence[nz.Autoregression]:
        """Noise from what is left once everything was set free."""
        left = [item.measured - item.expected(self._craft, {}) for item in self.items]
        spans = [item.spans for item in self.items]
        for turn in range(ROUNDS + 1):
            parts = [[part[c] - part[c].mean() for part in left] for c in range(len(SEEN))]
            self.noise = [nz.fit(part, spans, ORDER) if turn else nz.white(part, spans, ORDER) for part in parts]
            self._whitened = [None for _ in self.items]
            if turn < ROUNDS:
                left = [self._without(i) for i in range(len(self.items))]
        return self.noise

    def _without(self, flight: int) -> Floats:
        """What is left of a flight (C, B) about its own best lag, delay and all the rest."""
        item, slopes = self.items[flight], self._slopes[flight]
        columns = np.concatenate([item.local, np.array([slopes[key] for key in KEYS])])
        std = np.concatenate([item.local_std, np.full(len(KEYS), FREE)])
        left = item.measured - item.expected(self._craft, {})
        full = self._columns(flight) * std
        solved = np.linalg.solve(np.eye(len(std)) + full.T @ full, full.T @ self._white(item, left[..., None])[:, 0])
        return np.asarray(left - np.tensordot(std * solved, columns, axes=1))
