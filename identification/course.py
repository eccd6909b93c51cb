"""A rig's log on one even clock: what was put in and what every joint did."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightlog.errors import UserError
from flightlog.tables import Table
from sim.rig import Rig

Floats = NDArray[np.float64]

SHORTEST = 20  # rows that a stretch must have
GAP = 5.0  # times the usual step, from which on a log is torn in two


@dataclass(frozen=True, eq=False)
class Course:
    """One stretch of a log without gaps. Rows `dt` apart from `t0` on."""

    name: str
    t0: float  # [s]
    dt: float
    inputs: Floats  # (N, I) in the order of the rig's inputs, as held from each row to the next
    angles: Floats  # (N, J) [rad] in the order of its joints

    @property
    def t(self) -> Floats:
        """Times (N,) [s]."""
        return np.asarray(self.t0 + self.dt * np.arange(len(self.angles)), np.float64)

    def part(self, start: float, end: float) -> "Course":
        """The rows of start <= t < end."""
        rows = np.flatnonzero((self.t >= start - 1e-9) & (self.t < end - 1e-9))
        if not len(rows):
            raise UserError(f"{self.name}: no rows between {start:g} and {end:g} s")
        first, last = int(rows[0]), int(rows[-1]) + 1
        return Course(self.name, self.t0 + first * self.dt, self.dt, self.inputs[first:last], self.angles[first:last])


def courses(name: str, tables: Mapping[str, Table], rig: Rig) -> list[Course]:
    """The stretches of a log, each on the clock of its joints; UserError where rig and log do not fit."""
    for topic, wanted in (("joints", rig.joints), ("controls", rig.inputs)):
        if topic not in tables:
            raise UserError(f"{name}: no topic {topic}; {rig.name} needs {', '.join(f'{topic}.{w}' for w in wanted)}")
        for column in wanted:
            if column not in tables[topic]:
                raise UserError(
                    f"{name}: no {topic}.{column}, which {rig.name} needs; {topic} has "
                    f"{', '.join(c for c in tables[topic].columns if c != 't')}"
                )
    joints, controls = tables["joints"], tables["controls"]
    if len(joints) < SHORTEST:
        raise UserError(f"{name}: joints has {len(joints)} rows; {SHORTEST} or more would be enough")
    found = []
    for part in range(len(joints.segments)):
        table = joints.segment(part)
        drive = controls.segment(part) if len(controls.segments) == len(joints.segments) else controls
        t = table["t"]
        angles = table.stack(*rig.joints)
        good = np.isfinite(angles).all(axis=1) & np.append(True, np.diff(t) > 0.0)
        t, angles = t[good], angles[good]
        if len(t) < SHORTEST:
            continue
        dt = float(np.median(np.diff(t)))
        tears = np.flatnonzero(np.diff(t) > GAP * dt) + 1
        for rows in np.split(np.arange(len(t)), tears):
            if len(rows) >= SHORTEST:
                found.append(_even(name, t[rows], angles[rows], drive, rig, dt))
    if not found:
        raise UserError(f"{name}: joints has no {SHORTEST} rows in a row")
    return found


def _even(name: str, t: Floats, angles: Floats, controls: Table, rig: Rig, dt: float) -> Course:
    clock = t[0] + dt * np.arange(round((t[-1] - t[0]) / dt) + 1)
    even = np.column_stack([np.interp(clock, t, column) for column in angles.T])
    inputs = np.empty((len(clock), len(rig.inputs)))
    for i, column in enumerate(rig.inputs):
        u = np.asarray(controls[column], float)
        told = np.isfinite(u)
        if not told.any():
            raise UserError(f"{name}: controls.{column} has no numbers")
        when = controls["t"][told]
        held = np.searchsorted(when, clock + 0.01 * dt, side="right") - 1  # commands hold until the next
        inputs[:, i] = u[told][np.maximum(held, 0)]
    return Course(name, float(clock[0]), dt, inputs, even)


def causal_states(course: Course, span: float) -> Floats:
    """State (N, 2 J), angles and rates, at every row from that row and those before it alone.

    span [s]: of the parabola that is fitted to the last rows.
    """
    n, j = course.angles.shape
    full = max(3, round(span / course.dt) + 1)
    found = np.zeros((n, 2 * j))
    for rows in range(2, full + 1):
        x = np.arange(1 - rows, 1) * course.dt
        weights = np.linalg.pinv(np.vander(x, 3 if rows >= full // 2 + 2 else 2, increasing=True))[:2]
        where = slice(rows - 1, rows) if rows < full else slice(rows - 1, n)
        for joint in range(j):
            windows = np.lib.stride_tricks.sliding_window_view(course.angles[:, joint], rows)
            part = windows[where.start - rows + 1 : (n if rows == full else where.stop) - rows + 1]
            found[where, joint], found[where, j + joint] = (part @ weights.T).T
    found[0, :j] = course.angles[0]
    return found
