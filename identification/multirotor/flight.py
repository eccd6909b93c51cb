"""One measured flight of a multirotor: its commands, and the accelerations that were measured, node by node.

Where there is an inertial sensor it is what was measured. Where there is none, the estimate (or a better reference)
is differentiated: climb once, attitude twice. An attitude that was not logged still says that the mean angular
acceleration of a long flight is nothing.

Whoever flies cancels the air's disturbances by commands, and answers the noise of sensors by them, so that commands
fluctuate more than the vehicle does. A model that answered less would seem better. Numbers are therefore judged by
balances: about M(u; n), n nominal, the model moves as it does along the voltage's slow course and the commands s as
they follow that on the whole, M(u; n) + M(s; theta) - M(s; n). For the same reason what a passing load takes off the
voltage is put back first: a gust that is answered by less command would raise the voltage, and look like sag. And the
speed that counts within a node is that at its beginning and what the thrust, tilted as it was, has made of it since:
the gust within the node has made none of it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from flightlog.constants import GRAVITY
from flightlog.errors import UserError
from flightlog.tables import Table
from identification.multirotor.motion import CHANNELS, IMU, LEAST_LIFT, Motion, Seen, column, on
from identification.multirotor.settled import settled
from sim.multirotor.file import Multirotor
from sim.multirotor.model import Inputs, answer

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# [s] by whether accelerations are differences of an estimate; shorter ones leave less time to answer a gust within
NODE = {True: 0.5, False: 0.25}
IDLE = 0.02  # of full command, below which the battery rests
RESTED = 0.3  # [s] at least, before anything turns
STEPS = 0.002, 0.02  # [s] shortest and longest step of the model along a log
CLEAR = 0.2  # [m] above the ground while a flight is looked at
EDGE = 0.5  # [s] left out behind the take-off and before the landing
LEAST = 5.0  # [s] in the air
FEWEST = 4.0  # [s] of a stretch that counts

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
    height: Floats  # (K,) [m] above the start, or where it began in the air above nothing; NaN where not known
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

    @property
    def flown(self) -> Ints:
        """(K, S) samples of each node."""
        return self.first[:, None] + np.arange(self.per_node)

    def _nodes(self, samples: Floats) -> list[Floats]:
        nodes = samples[self.flown].mean(axis=1)

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
    length = NODE[by_estimate]
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
    motion = Motion(tables, grid)
    inputs = Inputs(step, commands, column(tables, "battery", "voltage", grid), motion.body_velocity())
    lift = answer(craft, craft.values(), inputs)[:, 2]
    flying = uniform_filter1d((lift > LEAST_LIFT).astype(float), max(round(1.0 / step), 1)) > 0.5
    known, airborne = np.isfinite(motion.height), bool(flying[0])
    if not airborne:  # a log that begins in the air does not tell where the ground is
        flying &= ~known | (motion.height > CLEAR)
    first, spans = _stretches(flying, per_node, round(EDGE / step), round(FEWEST / length))
    if len(first) * length < LEAST:
        raise UserError(
            f"{name}: {len(first) * length:.1f} s in the air (rotors carrying {LEAST_LIFT / GRAVITY:.0%} of "
            f"{craft.mass:g} kg, {CLEAR:g} m above the start); at least {LEAST:g} s would be right"
        )
    samples = first[:, None] + np.arange(per_node)
    slow = settled(inputs, motion.led(step, lift, first, per_node), first, spans, per_node)

    def node(values: Floats) -> Floats:
        return np.asarray(values[samples].mean(axis=1))

    seen = motion.seen(first, per_node, step, by_estimate)
    if not any(s.channel == CHANNELS.index("force_z") for s in seen):
        raise UserError(f"{name}: nothing says how it climbs: imu.fz, or u or vu of estimate or reference, would")
    return Flight(
        name, float(grid[0]), float(np.median(np.diff(t))), inputs, slow, per_node,
        first, spans, node(grid), seen, by_estimate, node(motion.height_of(airborne)), node(motion.speed),
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


def _rest(inputs: Inputs) -> float:
    """[V] before anything turned; NaN where that was not logged."""
    turning = np.flatnonzero(inputs.commands.max(axis=1) > IDLE)
    idle = int(turning[0]) if len(turning) else len(inputs.commands)
    return float(np.median(inputs.voltage[:idle])) if idle * inputs.step >= RESTED else float("nan")


def _stretches(
    flying: NDArray[np.bool_], per_node: int, edge: int, fewest: int
) -> tuple[Ints, list[tuple[int, int]]]:
    """Samples at which nodes begin, and the nodes of each stretch in the air."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flying.astype(int), [0]])))
    first: list[int] = []
    spans = []
    for begin, end in zip(edges[::2] + edge, edges[1::2] - edge, strict=True):
        count = max((end - begin) // per_node, 0)
        if count < fewest:
            continue
        spans.append((len(first), len(first) + count))
        first += [int(begin) + i * per_node for i in range(count)]
    return np.array(first, int), spans
