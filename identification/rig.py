"""Flights of one rig in linear form; see `identification.bench.Bench`.

The model runs freely for STEP from each node, from the state measured there; by how much it misses every joint's
angle at the next node is one row a joint. What neighbouring rows share (slow disturbances, the noise of the first
state) is taken out by an autoregression fitted where everything that has a name is free.
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightlog.errors import UserError
from flightlog.tables import Table
from identification.bench import Baseline, Bench, Channel
from identification.causes import actuator_lag, input_nonlinearity, joint_friction, joint_stiffness
from identification.causes.contract import Cause
from identification.course import Course, causal_states, courses
from identification.free_run import SPAN
from identification.stack import Rows
from sim.rig import Rig
from sim.rig_motion import Moving

Floats = NDArray[np.float64]

STEP = 0.5  # [s] of each short run
ORDER = 2  # of the autoregression
ROUNDS = 3  # of the noise fit
SLOPE = 0.1  # of a prior, for a derivative
FEWEST = 30  # nodes


class RigBench:
    """Flights of one rig."""

    def __init__(
        self, logs: Mapping[str, Mapping[str, Table]], vehicle: Rig, like: "RigBench | None" = None
    ) -> None:
        """Prepare the flights and fit the noise; UserError for a log that cannot carry a diagnosis."""
        self.vehicle = vehicle
        self.names: Sequence[str] = list(logs)
        self.stretches = [courses(name, tables, vehicle) for name, tables in logs.items()]
        for name, parts in zip(logs, self.stretches, strict=True):
            nodes = sum(int(len(c.angles) * c.dt / STEP) for c in parts)
            if nodes < FEWEST:
                raise UserError(f"{name}: too short: {FEWEST * STEP:g} s or more would be enough")
        self._first = [[causal_states(c, SPAN) for c in parts] for parts in self.stretches]
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
        self._slopes: list[dict[str, Floats]] = [{} for _ in self.names]
        self._noise: list[tuple[Floats, float]]
        self._noise = like._noise if like is not None else self._fit_noise()
        levels = zip(vehicle.joints, self._noise, strict=True)
        self.baseline = Baseline(True, None, {f"joints.{joint}": (std, "rad") for joint, (_, std) in levels})

    def rows(self, flight: int, changes: Mapping[str, float], fresh: Collection[str] = ()) -> Rows:
        """See `Bench.rows`."""
        missed = self._missed(flight, changes)
        known = self._slopes[flight]
        for key in self.nominal:
            if key not in known or key in fresh:
                known[key] = self._slope(flight, key, changes, missed)
        residual = self._whiten(flight, missed)
        joints, nodes = len(self.vehicle.joints), len(missed)
        return Rows(
            residual=residual.T.ravel(),
            signatures={key: self._whiten(flight, slope).T.ravel() for key, slope in known.items()},
            local=np.zeros((joints * nodes, 0)),
            local_std=np.zeros(0),
            channel=np.repeat(np.arange(joints), nodes),
            t=np.tile(np.concatenate([c.t[rows[1:]] for c, rows in self._nodes(flight)]), joints),
        )

    def bounded(self, key: str, value: float) -> float:
        """See `Bench.bounded`."""
        number = self.vehicle.numbers[key]
        return min(max(value, number.low), number.high)

    def _causes(self) -> list[Cause]:
        rig, found = self.vehicle, []
        parts = [c for stretch in self.stretches for c in stretch]
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
        return found

    def _nodes(self, flight: int) -> list[tuple[Course, NDArray[np.int64]]]:
        return [(c, np.arange(0, len(c.angles), max(1, round(STEP / c.dt)))) for c in self.stretches[flight]]

    def _missed(self, flight: int, changes: Mapping[str, float]) -> Floats:
        """Measured angle less that of the model (nodes, joints), unwhitened."""
        found = []
        for (course, rows), first in zip(self._nodes(flight), self._first[flight], strict=True):
            moving = Moving(self.vehicle, course.dt, changes)
            length = int(rows[1] - rows[0]) + 1
            which = rows[:-1, None] + np.arange(length)
            states = moving.run(first[rows[:-1]], moving.torques(course.inputs)[which])
            found.append(course.angles[rows[1:]] - states[:, -1, : len(self.vehicle.joints)])
        return np.concatenate(found)

    def _slope(self, flight: int, key: str, changes: Mapping[str, float], missed: Floats) -> Floats:
        """What one unit more of a number takes off what is missed."""
        at = changes.get(key, self.nominal[key])
        step = SLOPE * max(self.spreads.get(key, 0.0), self.tolerances.get(key, 0.0))
        ahead = self.bounded(key, at + step)
        if ahead == at:
            ahead = at - step
        moved = dict(changes) | {key: ahead}
        if key.endswith(".centre") and not any(self._strength(moved, key)):
            return np.zeros_like(missed)  # a spring that pulls nothing has no centre
        return (missed - self._missed(flight, moved)) / (ahead - at)

    def _strength(self, values: Mapping[str, float], key: str) -> list[float]:
        at = self.vehicle.values(values)
        stem = key.rpartition(".")[0]
        return [at.get(f"{stem}.stiffness", 0.0), at.get(f"{stem}.cubic", 0.0)]

    def _whiten(self, flight: int, rows: Floats) -> Floats:
        """Innovations of the autoregression, in standard deviations."""
        found, start = np.zeros_like(rows), 0
        for _, nodes in self._nodes(flight):
            part = rows[start : start + len(nodes) - 1]
            for j, (weights, std) in enumerate(self._noise):
                left = part[:, j].copy()
                for lag, weight in enumerate(weights, start=1):
                    left[lag:] -= weight * part[:-lag, j]
                left[:ORDER] = 0.0
                found[start : start + len(part), j] = left / std
            start += len(part)
        return found

    def _fit_noise(self) -> list[tuple[Floats, float]]:
        """Autoregression and level of every joint, everything that has a name free."""
        count = len(self.vehicle.joints)
        self._noise = [(np.zeros(ORDER), self.vehicle.noise[joint]) for joint in self.vehicle.joints]
        missed = [self._missed(i, {}) for i in range(len(self.names))]
        slopes = [
            {key: self._slope(i, key, {}, missed[i]) for key in self.nominal} for i in range(len(self.names))
        ]
        width = np.array([max(self.spreads.get(k, 0.0), self.tolerances.get(k, 0.0)) for k in self.nominal])
        for _ in range(ROUNDS):
            j = np.concatenate(
                [np.column_stack([self._whiten(i, s).ravel() for s in slopes[i].values()]) for i in range(len(missed))]
            )
            r = np.concatenate([self._whiten(i, m).ravel() for i, m in enumerate(missed)])
            scaled = j * width
            best = width * np.linalg.solve(np.eye(len(width)) + scaled.T @ scaled, scaled.T @ r)
            left = [
                m - np.tensordot(best, np.stack(list(s.values())), 1) for m, s in zip(missed, slopes, strict=True)
            ]
            self._noise = [_autoregression([part[:, k] for part in left]) for k in range(count)]
        self._slopes = [dict(s) for s in slopes]
        return self._noise


def _autoregression(parts: Sequence[Floats]) -> tuple[Floats, float]:
    """Weights of the last ORDER values, and the level of what is new, robust against a few large ones."""
    x = np.concatenate([np.column_stack([p[ORDER - k : len(p) - k] for k in range(1, ORDER + 1)]) for p in parts])
    y = np.concatenate([p[ORDER:] for p in parts])
    weights = np.linalg.solve(x.T @ x + 1e-12 * np.eye(ORDER), x.T @ y)
    left = y - x @ weights
    most = 4.0 * 1.48 * float(np.median(np.abs(left)))
    return weights, max(float(np.sqrt(np.mean(np.clip(left, -most, most) ** 2))), 1e-9)


def open_bench(logs: Mapping[str, Mapping[str, Table]], vehicle: Rig, like: Bench | None = None) -> RigBench:
    """See `identification.bench.OpenBench`."""
    return RigBench(logs, vehicle, like if isinstance(like, RigBench) else None)
