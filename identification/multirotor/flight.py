"""One measured flight of a multirotor: its commands, and the accelerations that were measured, node by node.

Where there is an inertial sensor it is what was measured. Where there is none, the estimate (or a better reference)
is differentiated: climb once, attitude twice. An attitude that was not logged still says that the mean angular
acceleration of a long flight is nothing.

Whoever flies cancels the air's disturbances by commands, and answers the noise of sensors by them, so that commands
fluctuate more than the vehicle does. A model that answered less would seem better. Numbers are therefore judged by
balances: about M(u; n), n nominal, the model moves as it does at the flight's mean commands s and the voltage's slow
course, M(u; n) + M(s; theta) - M(s; n). For the same reason what a passing load takes off the voltage is put back
first: a gust that is answered by less command would raise the voltage, and look like sag. And the speed that counts for
a node is that at its beginning, which the gust within it has not made.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from flightlog.constants import GRAVITY
from flightlog.errors import UserError
from flightlog.tables import Table
from sim.multirotor.file import Multirotor
from sim.multirotor.model import Inputs, answer

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NODE = 0.5  # [s]
SMOOTH = 1.0  # [s] over which the voltage is smoothed for it
QUICK = 2.0  # [s] within which it follows the load alone
PASSING = 4.0  # [s] that no passing load lasts
IDLE = 0.02  # of full command, below which the battery rests
RESTED = 0.3  # [s] at least, before anything turns
STEPS = 0.002, 0.02  # [s] shortest and longest step of the model along a log
CLEAR = 0.2  # [m] above the ground while a flight is looked at
EDGE = 0.5  # [s] left out behind the take-off and before the landing
LIFTED = 0.6  # of its weight that the rotors carry in flight
LEAST = 5.0  # [s] in the air
FEWEST = 8  # nodes of a stretch that counts
SHORT = 0.02  # [s] over which rates are averaged at the ends of a node

IMU = ("fx", "fy", "fz", "wx", "wy", "wz")
CHANNELS = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")
UNITS = ("m/s^2", "m/s^2", "m/s^2", "rad/s^2", "rad/s^2", "rad/s^2")

WHOLE = (1.0,)
TWICE = (1 / 6, 4 / 6, 1 / 6)  # weights of the nodes in the second difference of means


@dataclass(frozen=True, eq=False)
class Seen:
    """One channel as measured: K nodes."""

    channel: int  # in CHANNELS
    measured: Floats  # (K,)
    kernel: tuple[float, ...]  # weights with which the model's nodes enter


@dataclass(frozen=True, eq=False)
class Flight:
    """A flight prepared: M samples of input, K nodes in the air."""

    name: str
    begins: float  # [s] of the first sample
    logged: float  # [s] between commands as they were logged
    inputs: Inputs
    slow: Inputs  # settled
    per_node: int  # samples
    first: Ints  # (K,) sample at which each node begins
    spans: Sequence[tuple[int, int]]  # first node of each stretch in the air, and the one behind its last
    t: Floats  # (K,) [s] middle of each node, the log's own clock
    seen: Sequence[Seen]
    by_estimate: bool  # no inertial sensor: accelerations come from differences
    height: Floats  # (K,) [m] above the start; NaN where not known
    speed: Floats  # (K,) [m/s] over ground; NaN where not known
    voltage: Floats  # (K,) [V]
    rest: float  # [V] of the battery before anything turned; NaN where not logged

    def expected(self, craft: Multirotor, changes: Mapping[str, float]) -> list[Floats]:
        """What the model answers in each channel seen, (K,) each, with some numbers changed."""
        plain = answer(craft, craft.values(), self.inputs)
        if not changes:
            return self._nodes(plain)
        moved = answer(craft, craft.values(changes), self.slow) - answer(craft, craft.values(), self.slow)
        return self._nodes(plain + moved)

    def _nodes(self, samples: Floats) -> list[Floats]:
        nodes = samples[self.first[:, None] + np.arange(self.per_node)].mean(axis=1)

        def along(s: Seen) -> Floats:
            parts = [np.pad(nodes[a:b, s.channel], len(s.kernel) // 2, mode="edge") for a, b in self.spans]
            return np.concatenate([np.convolve(part, s.kernel, "valid") for part in parts])

        return [along(s) for s in self.seen]


def has_imu(tables: Mapping[str, Table]) -> bool:
    """Whether a whole inertial sensor was logged."""
    return "imu" in tables and all(name in tables["imu"] for name in IMU)


def prepare(name: str, tables: Mapping[str, Table], craft: Multirotor, by_estimate: bool) -> Flight:
    """Bring a log to equal steps; UserError where it cannot carry a diagnosis.

    by_estimate: take accelerations by differences even where there is an inertial sensor.
    """
    topic, columns = _commands(name, tables, craft)
    table = tables[topic]
    t = np.asarray(table["t"], float)
    step = float(np.clip(np.median(np.diff(t)), *STEPS))
    length = NODE
    per_node = max(round(length / step), 1)
    step = length / per_node
    grid = np.arange(t[0], t[-1], step)
    commands = np.column_stack([on(grid, t, np.asarray(table[c], float)) for c in columns])
    if not np.isfinite(commands).all():
        raise UserError(f"{name}: {topic}: no numbers in {', '.join(columns)}")
    if not craft.by_speed and (np.nanmax(commands) > 1.01 or np.nanmin(commands) < -0.01):
        raise UserError(
            f"{name}: {topic}: commands lie in {np.nanmin(commands):g} .. {np.nanmax(commands):g}; 0 .. 1 would be "
            "right (`scale` in the mapping brings them there)"
        )
    motion = _Motion(tables, grid)
    inputs = Inputs(step, commands, _column(tables, "battery", "voltage", grid), motion.body_velocity())
    lift = answer(craft, craft.values(), inputs)[:, 2]
    flying = uniform_filter1d((lift > LIFTED * GRAVITY).astype(float), max(round(1.0 / step), 1)) > 0.5
    known = np.isfinite(motion.height)
    if not flying[0]:  # a log that begins in the air does not tell where the ground is
        flying &= ~known | (motion.height > CLEAR)
    first, spans = _stretches(flying, per_node, round(EDGE / step))
    if len(first) * length < LEAST:
        raise UserError(
            f"{name}: {len(first) * length:.1f} s in the air (rotors carrying {LIFTED:.0%} of {craft.mass:g} kg, "
            f"{CLEAR:g} m above the start); at least {LEAST:g} s would be right"
        )
    samples = first[:, None] + np.arange(per_node)

    def node(values: Floats) -> Floats:
        return np.asarray(values[samples].mean(axis=1))

    seen = motion.seen(first, per_node, step, by_estimate)
    if not any(s.channel == CHANNELS.index("force_z") for s in seen):
        raise UserError(f"{name}: nothing says how it climbs: imu.fz, or u or vu of estimate or reference, would")
    return Flight(
        name, float(grid[0]), float(np.median(np.diff(t))), inputs, _settled(inputs, first, spans, per_node),
        per_node, first, spans, node(grid), seen, by_estimate, node(motion.height), node(motion.speed),
        node(inputs.voltage), _rest(inputs),
    )  # fmt: skip


def _commands(name: str, tables: Mapping[str, Table], craft: Multirotor) -> tuple[str, list[str]]:
    """The topic that drives the rotors, what reaches the motors before what left the mixer, and its columns."""
    choices = {"rotor": "speed"} if craft.by_speed else {"actuators": "m", "controls": "m"}
    for topic, stem in choices.items():
        if topic in tables:
            columns = [f"{stem}{i + 1}" for i in range(craft.rotors)]
            if all(column in tables[topic] for column in columns):
                if f"{stem}{craft.rotors + 1}" in tables[topic]:
                    raise UserError(f"{name}: {topic}: more than the {craft.rotors} rotors of {craft.name}")
                return topic, columns
    wanted = " or ".join(f"{topic}.{stem}1..{stem}{craft.rotors}" for topic, stem in choices.items())
    raise UserError(f"{name}: lacks {wanted}, which drive {craft.name}")


def _settled(inputs: Inputs, first: Ints, spans: Sequence[tuple[int, int]], per_node: int) -> Inputs:
    """The mean command of the flight, and the voltage's slow course under it; what is not flown counts for nothing."""
    mean = inputs.commands[first[:, None] + np.arange(per_node)].mean(axis=(0, 1))
    load = inputs.commands.mean(axis=1)
    voltage = inputs.voltage.copy()
    stretches = [slice(int(first[a]), int(first[b - 1]) + per_node) for a, b in spans]
    drop = _drop([load[s] for s in stretches], [voltage[s] for s in stretches], round(QUICK / inputs.step))
    for s in stretches:
        narrow, wide = (min(max(round(w / inputs.step), 1), s.stop - s.start) for w in (SMOOTH, PASSING))
        passing = load[s] - uniform_filter1d(load[s], wide, mode="nearest")
        voltage[s] = uniform_filter1d(voltage[s] + drop * passing, narrow, mode="nearest")
    velocity = inputs.velocity.copy()
    for k in first:
        velocity[k : k + per_node] = velocity[k]
    return replace(inputs, commands=np.broadcast_to(mean, inputs.commands.shape), voltage=voltage, velocity=velocity)


def _drop(loads: Sequence[Floats], voltages: Sequence[Floats], width: int) -> float:
    """[V] that the voltage drops at once by full command, from what both do within `width` samples."""
    quick = [[x - uniform_filter1d(x, min(width, len(x)), mode="nearest") for x in xs] for xs in (loads, voltages)]
    load, voltage = (np.concatenate(parts) for parts in quick)
    return float(max(-(load @ voltage) / max(float(load @ load), 1e-12), 0.0))


def _rest(inputs: Inputs) -> float:
    """[V] before anything turned; NaN where that was not logged."""
    turning = np.flatnonzero(inputs.commands.max(axis=1) > IDLE)
    idle = int(turning[0]) if len(turning) else len(inputs.commands)
    return float(np.median(inputs.voltage[:idle])) if idle * inputs.step >= RESTED else float("nan")


def on(grid: Floats, t: Floats, values: Floats) -> Floats:
    """A column brought to a grid of times; NaN where there is nothing."""
    good = np.isfinite(values)
    return np.interp(grid, t[good], values[good]) if good.sum() > 1 else np.full(len(grid), np.nan)


def _column(tables: Mapping[str, Table], topic: str, name: str, grid: Floats) -> Floats:
    if topic not in tables or name not in tables[topic]:
        return np.full(len(grid), np.nan)
    return on(grid, np.asarray(tables[topic]["t"], float), np.asarray(tables[topic][name], float))


def _stretches(flying: NDArray[np.bool_], per_node: int, edge: int) -> tuple[Ints, list[tuple[int, int]]]:
    """Samples at which nodes begin, and the nodes of each stretch in the air."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flying.astype(int), [0]])))
    first: list[int] = []
    spans = []
    for begin, end in zip(edges[::2] + edge, edges[1::2] - edge, strict=True):
        count = max((end - begin) // per_node, 0)
        if count < FEWEST:
            continue
        spans.append((len(first), len(first) + count))
        first += [int(begin) + i * per_node for i in range(count)]
    return np.array(first, int), spans


class _Motion:
    """What a log says of the motion, on one grid."""

    def __init__(self, tables: Mapping[str, Table], grid: Floats) -> None:
        self.grid = grid
        self._tables = tables
        height = self._get("u")
        if not np.isfinite(height).any():
            height = _column(tables, "baro", "altitude", grid)
        start = height[np.isfinite(height)][:1]
        self.height: Floats = height - (start[0] if len(start) else 0.0)
        self._velocity = [self._get(name) for name in ("ve", "vn", "vu")]
        self.speed: Floats = np.hypot(self._velocity[0], self._velocity[1])
        self._roll, self._pitch, heading = (self._get(name) for name in ("roll", "pitch", "heading"))
        known = np.isfinite(heading).all()
        self._yaw = -np.unwrap(heading) if known else np.full(len(grid), np.nan)

    def _get(self, name: str) -> Floats:
        """A column of the reference, else of the estimate."""
        found = _column(self._tables, "reference", name, self.grid)
        if np.isfinite(found).any():
            return found
        turning = name == "heading" and "estimate" in self._tables and name in self._tables["estimate"]
        if turning:
            table = self._tables["estimate"]
            t, values = np.asarray(table["t"], float), np.asarray(table[name], float)
            good = np.isfinite(values)
            return np.interp(self.grid, t[good], np.unwrap(values[good])) if good.sum() > 1 else found
        return _column(self._tables, "estimate", name, self.grid)

    def body_velocity(self) -> Floats:
        """(M, 3) over ground in axes of the heading; zeros where not known."""
        east, north, up = self._velocity
        turn = self._yaw + np.pi / 2  # of x from east
        found = np.column_stack(
            [east * np.cos(turn) + north * np.sin(turn), -east * np.sin(turn) + north * np.cos(turn), up]
        )
        return np.asarray(np.nan_to_num(found))

    def seen(self, first: Ints, per_node: int, step: float, by_estimate: bool) -> list[Seen]:
        """Channels as measured over the nodes that begin at these samples."""
        samples, length = first[:, None] + np.arange(per_node), per_node * step
        last = len(self.grid) - 1
        ends = np.minimum(np.column_stack([first, first + per_node]), last)
        width = max(round(SHORT / step), 1)
        if not by_estimate:
            imu = [_column(self._tables, "imu", name, self.grid) for name in IMU]
            found = [Seen(i, imu[i][samples].mean(axis=1), WHOLE) for i in range(3)]
            for i in range(3):
                rate = uniform_filter1d(imu[3 + i], width)[ends]
                found.append(Seen(3 + i, (rate[:, 1] - rate[:, 0]) / length, WHOLE))
            return found

        def bend(values: Floats) -> Floats:
            """(K,) second difference of the means of nodes, over their length squared."""
            beside = [np.clip(samples + k * per_node, 0, last) for k in (-1, 0, 1)]
            before, here, behind = (values[at].mean(axis=1) for at in beside)
            return np.asarray(behind - 2.0 * here + before) / length**2

        found = []
        tilt = (np.cos(np.nan_to_num(self._roll)) * np.cos(np.nan_to_num(self._pitch)))[samples].mean(axis=1)
        climb = self._velocity[2]
        if np.isfinite(climb).all():
            rise = uniform_filter1d(climb, width)[ends]
            found.append(Seen(2, ((rise[:, 1] - rise[:, 0]) / length + GRAVITY) / tilt, WHOLE))
        elif np.isfinite(self.height).all():
            found.append(Seen(2, (bend(self.height) + GRAVITY) / tilt, TWICE))
        for i, angle in enumerate((self._roll, -self._pitch, self._yaw)):
            if np.isfinite(angle).all():
                found.append(Seen(3 + i, bend(angle), TWICE))
            else:
                found.append(Seen(3 + i, np.zeros(len(first)), WHOLE))
        return found
