"""The quick motion about the balance, where an inertial sensor saw it: it tells how late the rotors follow.

Commands answer what the sensor saw, its noise included, so the model is judged by innovations: what is left of the
accelerations is whitened by its own past (a long autoregression), and a command is known before what it causes. Beside
lag and delay everything is free that could be taken for them: every rotor's slope, the inertia, an offset and a drift.
Commands are delayed along a cubic spline: straight lines between them would smooth what is late by half a step, and a
smoother command, with less of the sensors' noise in it, explains better whether it is late or not.

Whoever flies by better sensors than those that were logged answers gusts before the log shows them. Where most of what
the commands do is such an answer, lag and delay come out wrong, by up to 33 and 12 ms in simulated hovers (more where
the control hardly damps); doublets tell them to a millisecond. So a flight is judged where gusts make a small share of
the moments only, and leaves lag and delay open, the more the larger that share.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import shift, uniform_filter1d

from flightlog.tables import Table
from identification.multirotor import noise as nz
from identification.multirotor.flight import Flight
from identification.multirotor.motion import IMU, on
from identification.stack import Rows
from sim.multirotor.file import Multirotor
from sim.multirotor.model import Inputs, answer

Floats = NDArray[np.float64]
NoiseFit = Callable[[Sequence[Floats], Sequence[nz.Spans], int], nz.Autoregression]

TAU, DELAY = "terms.motor.tau", "terms.motor.delay"
KEYS = TAU, DELAY
SEEN = 2, 3, 4, 5  # channels: along the rotors' axis and all moments
STEP = 0.01  # [s]
ORDER = 16  # steps of the autoregression
ROUNDS = 5  # of the fit of noise and numbers
SLOPE = 0.15  # of a rotor's thrust about the hover, and of the inertia
ANYWHERE = 3.0  # times the spread of what was measured: offset and drift
FREE = 0.05  # [s] of lag and delay, a round of that
FARTHEST = 0.02  # [s] to go in it
WITHIN = {TAU: (0.0, 0.5), DELAY: (-0.02, 0.5)}  # [s]
NUDGE = 0.001  # [s] either way for a derivative
CALM = 0.2  # [s] over which speed is averaged: its noise makes moments where thrust moves with it
SLOW = 10  # steps that are averaged to compare gusts with commands
# [s] by which lag and delay are open on a flight: at least, and times a power of the share of gusts over commands
OPEN = {TAU: (0.004, 0.5), DELAY: (0.002, 0.3)}
POWER = 1.5
QUIET = 0.07  # of that share, up to which a flight is judged
STAMPED = 0.3  # of a step between logged commands, by which their stamps are uncertain: when in it they were sent


@dataclass(frozen=True, eq=False)
class Quick:
    """One flight: C channels, B steps in the air."""

    flight: Flight
    inputs: Inputs  # the flight's, without the noise of its speed
    block: int  # samples of the flight's inputs that are a step
    first: NDArray[np.int64]  # (B,) sample at which each step begins
    spans: Sequence[tuple[int, int]]  # first step of each stretch, and the one behind its last
    t: Floats  # (B,) [s]
    measured: Floats  # (C, B)
    local: Floats  # (L, C, B) of what is free beside
    local_std: Floats  # (L,)

    def expected(self, craft: Multirotor, changes: Mapping[str, float]) -> Floats:
        """What the model answers (C, B)."""
        values, inputs = craft.values(changes), self.inputs
        if (late := values[DELAY] / inputs.step) != 0.0:
            inputs = replace(inputs, commands=shift(inputs.commands, (late, 0.0), order=3, mode="nearest"))
        samples = answer(craft, values | {DELAY: 0.0}, inputs)[:, SEEN]
        within = self.first[:, None] + np.arange(self.block)
        found = samples[within].mean(axis=1)
        # rates at either end of a step tell the mean of the moments between, forces are told at the samples themselves
        behind = np.minimum(within + 1, len(samples) - 1)
        found[:, 1:] = 0.5 * (found[:, 1:] + samples[behind, 1:].mean(axis=1))
        return np.asarray(found.T)


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
    width = max(round(CALM / inputs.step), 1)
    inputs = replace(inputs, velocity=uniform_filter1d(inputs.velocity, width, axis=0, mode="nearest"))
    bare = Quick(
        flight, inputs, block, at, spans, grid[at] + 0.5 * length, measured, np.zeros((0, *measured.shape)), np.zeros(0)
    )
    local, std = _beside(bare, craft)
    return Quick(flight, inputs, block, at, spans, bare.t, measured, local, std)


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
    """The quick motion of all flights, with its noise.

    A flight tells lag and delay far more sharply than anything is believed of them beforehand. Every flight is
    therefore linear about its own best values, whatever is wrong with the vehicle.
    """

    def __init__(self, items: Sequence[Quick], craft: Multirotor, like: "Moving | None" = None) -> None:
        """Fit each flight, and the noise, unless that is to be `like` another's."""
        self.items = items
        self._craft = craft
        usual = craft.values()
        self._own: list[dict[str, float]] = [{key: usual[key] for key in KEYS} for _ in items]
        self._slopes: list[Floats] = [self.slopes(i) for i in range(len(items))]
        left = [item.measured - item.expected(craft, {}) for item in items]
        self.noise: Sequence[nz.Autoregression] = like.noise if like is not None else self._noise(left, nz.white)
        for _ in range(ROUNDS):
            left = [self._improved(i) for i in range(len(items))]
            if like is None:
                self.noise = self._noise(left, nz.fit)
        self._shares = [self._answered(i, left[i]) for i in range(len(items))]
        self._known: list[tuple[Floats, Floats] | None] = [None for _ in items]

    def slopes(self, flight: int) -> Floats:
        """What a second more of lag and delay does (2, C, B), about the flight's own."""
        item, own, found = self.items[flight], self._own[flight], []
        for key in KEYS:
            ahead, behind = own[key] + NUDGE, own[key] - NUDGE
            if key == TAU:
                behind = max(behind, 0.0)
            there, here = (item.expected(self._craft, own | {key: value}) for value in (ahead, behind))
            found.append((there - here) / (ahead - behind))
        return np.array(found)

    def rows(self, flight: int, changes: Mapping[str, float], keys: Sequence[str]) -> Rows:
        """Whitened rows, none of a flight that is not judged; numbers other than lag and delay do nothing here."""
        item, own = self.items[flight], self._own[flight]
        if self._shares[flight] > QUIET:
            none = np.zeros(0)
            return Rows(none, dict.fromkeys(keys, none), np.zeros((0, 0)), none, np.zeros(0, np.int64), none)
        known = self._known[flight]
        if known is None:
            left = item.measured - item.expected(self._craft, own)
            local = np.concatenate([item.local, self._slopes[flight]])
            known = self._known[flight] = (
                self._white(item, left[..., None])[:, 0], self._white(item, np.moveaxis(local, 0, -1))
            )  # fmt: skip
        left, local = known
        late = local[:, -len(KEYS) :]
        values = self._craft.values({key: value for key, value in changes.items() if key in KEYS})
        signatures = dict(zip(KEYS, late.T.copy(), strict=True))
        nothing = np.zeros(len(left))
        return Rows(
            residual=left - late @ np.array([values[key] - own[key] for key in KEYS]),
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

    def _answered(self, flight: int, left: Floats) -> float:
        """Share of the moments about the level axes that gusts make (left over), over what commands make."""
        item = self.items[flight]
        usual = item.expected(self._craft, {})

        def power(parts: Floats) -> Floats:
            whole = parts[1:3, : parts.shape[1] // SLOW * SLOW]
            return np.asarray(whole.reshape(2, -1, SLOW).mean(axis=2).var(axis=1))

        return float(np.mean(np.minimum(power(left) / np.maximum(power(usual), 1e-12), 1.0)))

    def _open(self, flight: int) -> Floats:
        """(2,) [s] by which a flight leaves lag and delay open."""
        grown = self._shares[flight] ** POWER
        return np.array([max(least, grown * most) for least, most in (OPEN[key] for key in KEYS)])

    def _white(self, item: Quick, parts: Floats) -> Floats:
        """(C, B, L) -> (R, L)."""
        return np.concatenate([self.noise[c].whiten(part, item.spans) for c, part in enumerate(parts)])

    def _noise(self, left: Sequence[Floats], how: NoiseFit) -> Sequence[nz.Autoregression]:
        """Noise of each channel from what flights leave (C, B)."""
        spans = [item.spans for item in self.items]
        return [how([part[c] - part[c].mean() for part in left], spans, ORDER) for c in range(len(SEEN))]

    def _improved(self, flight: int) -> Floats:
        """Bring a flight's lag and delay nearer to its own best values, all the rest free; what is left (C, B)."""
        item, own = self.items[flight], self._own[flight]
        columns = np.concatenate([item.local, self._slopes[flight]])
        std = np.concatenate([item.local_std, np.full(len(KEYS), FREE)])
        left = item.measured - item.expected(self._craft, own)
        full = self._white(item, np.moveaxis(columns, 0, -1)) * std
        solved = np.linalg.solve(np.eye(len(std)) + full.T @ full, full.T @ self._white(item, left[..., None])[:, 0])
        for key, step in zip(KEYS, std[-len(KEYS) :] * solved[-len(KEYS) :], strict=True):
            own[key] = float(np.clip(own[key] + np.clip(step, -FARTHEST, FARTHEST), *WITHIN[key]))
        self._slopes[flight] = self.slopes(flight)
        return np.asarray(left - np.tensordot(std * solved, columns, axes=1))
