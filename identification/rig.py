"""Flights of one rig in linear form; see `identification.bench.Bench`.

The model runs from the smoothed motion for STEP from each node; by how much it misses the next one goes through the
filter of `identification.rig_filter`, whose innovations are the rows. Their noise is fitted where everything that has
a name is free, and the filter is linear about that.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from scipy.signal import savgol_filter

from flightlog.errors import UserError
from flightlog.tables import Table
from identification.bench import Baseline, Bench, Channel
from identification.causes import actuator_delay, actuator_lag, input_nonlinearity, joint_friction, joint_stiffness
from identification.causes.contract import Cause
from identification.course import Course, courses
from identification.null import UNJUDGED
from identification.rig_filter import SETTLING, Linear, Noise, fit_noise, innovations
from identification.stack import Rows, Stack, stack
from sim.rig import Rig
from sim.rig_motion import Moving

Floats = NDArray[np.float64]

STEP = 0.04  # [s] from node to node
FINE = 0.0025  # [s] of the model's own steps: they act half of one early, and 5 ms were named a delay in every null
SMOOTHED = 0.06, 0.12, 0.24, 0.48  # [s] of the parabola through the motion
AGREED = 2.5  # standard deviations, within which the rates of two agree
SHORTEST = 15.0  # [s] of a log
ROUNDS = 6  # of the noise fit
IMPERFECT = 0.02  # of the usual acceleration, which no model accounts for
DAMPINGS = (0.0, 0.1, 1.0, 10.0, 100.0)  # of a step, one after the other until it leads downward
SLOPE = 0.1  # of a prior, for a derivative
NUDGE = 0.002, 0.02  # [rad, rad/s] for the transition
HUBER = 3.5  # standard deviations, to which a larger innovation is taken in
ODD = 0.05  # share of such, beyond which the model is none
REMEMBERED = 0.2  # correlation of neighbouring innovations, beyond which the model is none


@dataclass(frozen=True, eq=False)
class Nodes:
    """One stretch: where the model starts, and what came of it."""

    course: Course
    rows: NDArray[np.int64]  # (N + 1,)
    states: Floats  # (N + 1, 2 J) smoothed
    seen: Floats  # (N + 1, J) measured less smoothed

    @property
    def length(self) -> int:
        """Rows from node to node."""
        return int(self.rows[1] - self.rows[0])

    def reached(self, moving: Moving, first: Floats) -> Floats:
        """States (N, 2 J) at the next nodes, from `first` (N, 2 J)."""
        which = self.rows[:-1, None] + np.arange(self.length + 1)
        return np.asarray(moving.run(first, moving.torques(self.course.inputs)[which])[:, -1])


def _nodes(course: Course, noise: Floats) -> Nodes:
    """A stretch cut into steps; noise (J,) [rad]: of a row."""
    step = max(1, round(STEP / course.dt))
    states = smoothed(course.angles, course.dt, noise)
    joints, rows = course.angles.shape[1], np.arange(0, len(course.angles), step)
    # one row, not the mean of those around: where a torque jumps, the smoothed motion is off by more than the noise
    return Nodes(course, rows, states[rows], (course.angles - states[:, :joints])[rows])


def smoothed(angles: Floats, dt: float, noise: Floats) -> Floats:
    """States (N, 2 J) by parabolas through angles (N, J), each as wide as the motion allows.

    The widest whose rate agrees with that of all narrower ones within the noise (intersection of confidence intervals:
    Goldenshluger and Nemirovski 1997). A joint that stands still then has no rate, where a narrow parabola would have
    it shake, with a dry friction that takes the shaking for motion.
    """
    rows, joints = angles.shape
    found = np.zeros((rows, 2 * joints))
    low, high = np.full((rows, joints), -np.inf), np.full((rows, joints), np.inf)
    agreed = np.ones((rows, joints), bool)
    for span in SMOOTHED:
        half = max(2, round(span / dt / 2.0))
        if 2 * half + 1 > rows:
            break
        angle = savgol_filter(angles, 2 * half + 1, 2, axis=0)
        rate = savgol_filter(angles, 2 * half + 1, 2, deriv=1, delta=dt, axis=0)
        off = AGREED * noise / (dt * np.sqrt(2.0 * np.sum(np.arange(1, half + 1) ** 2)))
        low, high = np.maximum(low, rate - off), np.minimum(high, rate + off)
        agreed &= low <= high
        found = np.where(np.hstack([agreed, agreed]), np.hstack([angle, rate]), found)
    return found


class RigBench:
    """Flights of one rig."""

    cheap = True  # slopes: all that moved are taken anew
    every_set = True  # few causes, quickly fitted: the search looks at all sets of them

    def __init__(
        self, logs: Mapping[str, Mapping[str, Table]], vehicle: Rig, like: "RigBench | None" = None
    ) -> None:
        """Prepare the flights and fit the noise; UserError for a log that cannot carry a diagnosis."""
        self.vehicle = vehicle
        self.names: Sequence[str] = list(logs)
        each = np.array([vehicle.noise[joint] for joint in vehicle.joints])
        self._flights = [[_nodes(c, each) for c in courses(name, tables, vehicle)] for name, tables in logs.items()]
        for name, parts in zip(logs, self._flights, strict=True):
            if sum(len(part.rows) * part.length * part.course.dt for part in parts) < SHORTEST:
                raise UserError(f"{name}: too short: {SHORTEST:g} s or more would be enough")
        self.causes: Sequence[Cause] = self._causes()
        self.not_testable: Mapping[str, Sequence[str]] = {}
        self.channels: Mapping[int, Channel] = {
            i: Channel(f"joints.{joint}", "rad") for i, joint in enumerate(vehicle.joints)
        }
        own = {p.key: p for cause in self.causes for p in cause.parameters}
        numbers = vehicle.numbers
        self.tolerances: Mapping[str, float] = {k: n.tolerance for k, n in numbers.items() if n.tolerance > 0.0}
        self.spreads: Mapping[str, float] = {
            key: max(p.spread, 3.0 * self.tolerances.get(key, 0.0)) for key, p in own.items()
        }
        keys = sorted({*own, *self.tolerances})
        self.nominal: Mapping[str, float] = {key: numbers[key].value for key in keys}
        self.units: Mapping[str, str] = {key: numbers[key].unit for key in keys}
        self._slopes: list[dict[str, list[Floats]]] = [{} for _ in self.names]
        self._at: dict[str, float] = {}  # about which the filter is linear
        self._linear: list[list[Linear]] = []  # by flight and stretch
        self._noise: Noise
        self._weights: list[Floats] = []  # by flight (N, J), of innovations that are too large to be noise
        self._expanded: tuple[Stack, dict[str, float]] | None = None
        if like is None:
            self.baseline = self._certify()
        else:
            self._noise, self._at, self.baseline = like._noise, like._at, like.baseline
            self._linear = [self._about(i, self._at) for i in range(len(self.names))]
            self._weigh()

    def rows(self, flight: int, changes: Mapping[str, float], fresh: Collection[str] = ()) -> Rows:
        """See `Bench.rows`."""
        defects = self._defects(flight, changes)
        known = self._slopes[flight]
        for key in self.nominal:
            if key not in known or key in fresh:
                known[key] = self._slope(flight, key, changes, defects)
        keys = list(known)
        residual, signatures = self._whitened(flight, defects, [known[key] for key in keys])
        joints, count = len(self.vehicle.joints), len(residual)
        t = np.concatenate([n.course.t[n.rows] for n in self._flights[flight]])
        return Rows(
            residual=residual.T.ravel(),
            signatures={key: signatures[:, :, i].T.ravel() for i, key in enumerate(keys)},
            local=np.zeros((joints * count, 0)),
            local_std=np.zeros(0),
            channel=np.repeat(np.arange(joints), count),
            t=np.tile(t, joints),
        )

    def expanded(self) -> tuple[Stack, dict[str, float]]:
        """The linear form about the fit with everything free, nearest to every truth, and how far from nominal."""
        if self._expanded is None:
            self._slopes = [{} for _ in self.names]
            rows = [self.rows(i, self._at) for i in range(len(self.names))]
            shift = {key: value - self.nominal[key] for key, value in self._at.items()}
            self._expanded = stack(rows, list(rows[0].signatures)), shift
        return self._expanded

    def start(self, names: Sequence[str]) -> dict[str, float]:
        """Where a fit of these causes, and of all that may be off anyway, had best begin; absolute."""
        about, shift = self.expanded()
        free = dict(self.tolerances)
        free |= {p.key: self.spreads[p.key] for c in self.causes if c.name in names for p in c.parameters}
        score = about.score + about.information @ np.array([shift.get(key, 0.0) for key in about.keys])
        d = np.array([free.get(key, 0.0) for key in about.keys])
        used = np.flatnonzero(d > 0.0)
        d = d[used]
        information = d[:, None] * about.information[np.ix_(used, used)] * d
        keys = [about.keys[i] for i in used]
        nominal = np.array([self.nominal[key] for key in keys])
        values = self._within(keys, nominal, d, np.eye(len(d)) + information, d * score[used])
        linear = dict(zip(keys, values.tolist(), strict=True))
        # far from every truth the line leads nowhere: then better from nominal
        spent = float((((values - nominal) / d) ** 2).sum())
        return linear if self._square(linear) + spent < self._square({}) else {}

    def _square(self, changes: Mapping[str, float]) -> float:
        """Sum of the squares of all innovations, in standard deviations."""
        parts = (self._whitened(i, self._defects(i, changes), [])[0] for i in range(len(self.names)))
        return float(sum((part**2).sum() for part in parts))

    def _within(self, keys: Sequence[str], at: Floats, d: Floats, square: Floats, pull: Floats) -> Floats:
        """Where at + d x lies for the x of square x = pull, within every number's range.

        What others would make good for a friction below nothing must not be clipped afterwards.
        """
        low, high = (np.array([self.bounded(key, side * np.inf) for key in keys]) for side in (-1.0, 1.0))
        root = np.linalg.cholesky(square).T
        wanted = np.linalg.solve(root.T, pull)
        step = lsq_linear(root, wanted, ((low - at) / d - 1e-12, (high - at) / d + 1e-12), method="bvls").x
        return np.asarray(np.clip(at + d * step, low, high), float)

    def bounded(self, key: str, value: float) -> float:
        """See `Bench.bounded`."""
        number = self.vehicle.numbers[key]
        return min(max(value, number.low), number.high)

    def _causes(self) -> list[Cause]:
        rig, found = self.vehicle, []
        parts = [n.course for nodes in self._flights for n in nodes]
        torques = np.concatenate([np.abs(Moving(rig, c.dt).torques(c.inputs)) for c in parts])
        inputs = np.concatenate([np.abs(c.inputs) for c in parts])
        for i, joint in enumerate(rig.joints):
            usual = max(float(np.percentile(torques[:, i], 90)), 1e-9)
            found.append(joint_friction.of(joint, i + 1, len(rig.joints), usual))
            found.append(joint_stiffness.of(joint, i + 1, len(rig.joints), usual))
        for i, name in enumerate(rig.inputs):
            if np.ptp(np.concatenate([c.inputs[:, i] for c in parts])) > 0.0:  # one that never changes shows nothing
                size = max(float(np.percentile(inputs[:, i], 90)), 1e-9)
                found.append(input_nonlinearity.of(name, i + 1, len(rig.inputs), size, rig.units[name]))
                found.append(actuator_lag.of_input(name, i + 1, len(rig.inputs)))
                found.append(actuator_delay.of_input(name, i + 1, len(rig.inputs)))
        return found

    def _defects(self, flight: int, changes: Mapping[str, float]) -> list[Floats]:
        """By stretch, where the model goes less where the motion went (N, 2 J)."""
        found = []
        for nodes in self._flights[flight]:
            moving = Moving(self.vehicle, nodes.course.dt, changes, FINE)
            found.append(nodes.reached(moving, nodes.states[:-1]) - nodes.states[1:])
        return found

    def _slope(
        self, flight: int, key: str, changes: Mapping[str, float], defects: Sequence[Floats]
    ) -> list[Floats]:
        """What one unit more of a number adds to the defects."""
        at = changes.get(key, self.nominal[key])
        step = SLOPE * max(self.spreads.get(key, 0.0), self.tolerances.get(key, 0.0))
        ahead = self.bounded(key, at + step)
        if ahead == at:
            ahead = at - step
        moved = dict(changes) | {key: ahead}
        if key.endswith(".centre") and not any(self._strength(moved, key)):
            return [np.zeros_like(part) for part in defects]  # a spring that pulls nothing has no centre
        return [
            (there - here) / (ahead - at) for there, here in zip(self._defects(flight, moved), defects, strict=True)
        ]

    def _strength(self, values: Mapping[str, float], key: str) -> list[float]:
        at = self.vehicle.values(values)
        stem = key.rpartition(".")[0]
        return [at.get(f"{stem}.stiffness", 0.0), at.get(f"{stem}.cubic", 0.0)]

    def _about(self, flight: int, changes: Mapping[str, float]) -> list[Linear]:
        """The model's transitions about the smoothed motion."""
        found, size = [], 2 * len(self.vehicle.joints)
        nudge = np.repeat(NUDGE, len(self.vehicle.joints))
        for nodes in self._flights[flight]:
            moving = Moving(self.vehicle, nodes.course.dt, changes, FINE)
            columns = []
            for i in range(size):
                aside = np.eye(size)[i] * nudge
                ahead, behind = (nodes.reached(moving, nodes.states[:-1] + side) for side in (aside, -aside))
                columns.append((ahead - behind) / (2.0 * nudge[i]))
            h = nodes.length * nodes.course.dt
            found.append(Linear(h, np.stack(columns, axis=2), nodes.seen))
        return found

    def _whitened(
        self, flight: int, defects: Sequence[Floats], slopes: Sequence[Sequence[Floats]]
    ) -> tuple[Floats, Floats]:
        """Innovations (N, J) in standard deviations, and what every slope takes off them (N, J, K)."""
        found = []
        for part, linear in enumerate(self._linear[flight]):
            columns = np.stack([defects[part], *(slope[part] for slope in slopes)], axis=2)
            found.append(innovations(linear, self._noise, columns)[0])
        all_of_it = np.concatenate(found)
        if self._weights:
            all_of_it = all_of_it * self._weights[flight][:, :, None]
        return all_of_it[:, :, 0], -all_of_it[:, :, 1:]

    def _certify(self) -> Baseline:
        """Fit the noise, everything that has a name free, and ask whether what is left is noise."""
        rig, flights = self.vehicle, range(len(self.names))
        width = {k: max(self.spreads.get(k, 0.0), self.tolerances.get(k, 0.0)) for k in self.nominal}
        rough = np.array([rig.noise[joint] for joint in rig.joints])
        start = self._noise = Noise(rough, 100.0 * rough, 30.0 * rough)
        least = IMPERFECT * np.maximum(self._accelerations(), 50.0 * rough)
        for _ in range(ROUNDS):
            self._linear = [self._about(i, self._at) for i in flights]
            defects = [self._defects(i, self._at) for i in flights]
            parts = [(a, d) for i in flights for a, d in zip(self._linear[i], defects[i], strict=True)]
            self._noise = fit_noise(parts, start, least)
            moved = self._improved(width)
            if all(abs(moved[k] - self._at.get(k, self.nominal[k])) < 0.1 * width[k] for k in moved):
                break
            self._at = moved
        self._slopes = [{} for _ in self.names]
        self._weigh()
        reasons = []
        left = [self._whitened(i, self._defects(i, self._at), [])[0][SETTLING:] for i in flights]
        for j, joint in enumerate(rig.joints):
            square = float(np.mean(np.concatenate([part[:, j] for part in left]) ** 2))
            memory = float(np.mean([np.mean(part[1:, j] * part[:-1, j]) for part in left])) / square
            odd = float(np.mean(np.concatenate([w[:, j] for w in self._weights]) < 1.0))
            if odd > ODD:
                reasons.append(f"joints.{joint}: {100.0 * odd:.0f} % of the innovations are no noise")
            elif square > UNJUDGED:
                reasons.append(f"joints.{joint}: innovations are {square:.2f} times their noise (squared)")
            elif memory > REMEMBERED:  # alike the other way round: the disturbance is allowed more than there is
                reasons.append(f"joints.{joint}: neighbouring innovations are alike by {memory:.2f}")
        noise = {f"joints.{joint}": (float(self._noise.angle[j]), "rad") for j, joint in enumerate(rig.joints)}
        return Baseline(not reasons, "; ".join(reasons) or None, noise)

    def _weigh(self) -> None:
        """Take in what is beyond HUBER: a joint that turns while it sticks is no straight line."""
        self._weights = []
        left = [self._whitened(i, self._defects(i, self._at), [])[0] for i in range(len(self.names))]
        self._weights = [np.minimum(1.0, HUBER / np.maximum(np.abs(part), 1e-9)) for part in left]

    def _accelerations(self) -> Floats:
        """Usual size (J,) [rad/s^2] of what the joints do."""
        joints = len(self.vehicle.joints)
        parts = [np.diff(n.states[:, joints:], axis=0) / (n.length * n.course.dt) for f in self._flights for n in f]
        return np.asarray(np.sqrt(np.mean(np.concatenate(parts) ** 2, axis=0)), float)

    def _improved(self, width: Mapping[str, float]) -> dict[str, float]:
        """Everything that has a name one step better, about where it is."""
        keys = [key for key in width if width[key] > 0.0]
        at = np.array([self._at.get(key, self.nominal[key]) for key in keys])
        nominal = np.array([self.nominal[key] for key in keys])
        d = np.array([width[key] for key in keys])
        self._slopes = [{} for _ in self.names]
        rows = [self.rows(i, self._at) for i in range(len(self.names))]
        j = np.concatenate([np.column_stack([r.signatures[key] for key in keys]) for r in rows]) * d
        r = np.concatenate([part.residual for part in rows])

        def cost(values: Floats) -> float:
            spent = float((((values - nominal) / d) ** 2).sum())
            return self._square(dict(zip(keys, values.tolist(), strict=True))) + spent

        spent = (at - nominal) / d
        square = j.T @ j
        before = cost(at)
        for damping in DAMPINGS:
            damped = np.eye(len(d)) + square + damping * np.diag(np.diag(square))
            there = self._within(keys, at, d, damped, j.T @ r - spent)
            if cost(there) < before:
                return dict(zip(keys, there.tolist(), strict=True))
        return dict(zip(keys, at.tolist(), strict=True))


def open_bench(logs: Mapping[str, Mapping[str, Table]], vehicle: Rig, like: Bench | None = None) -> RigBench:
    """See `identification.bench.OpenBench`."""
    return RigBench(logs, vehicle, like if isinstance(like, RigBench) else None)
