"""One joint of a rig moved by itself, all others as they were measured: thousands of runs a second.

For comparing many structures of a joint's friction, spring and inputs; `sim.rig_motion` has the last word. Inertia and
gravity are MuJoCo's at the measured angles, torques those of the rig's own terms; products of rates are left out.
"""

import math
from collections.abc import Mapping

import mujoco
import numba
import numpy as np
from numpy.typing import NDArray

from identification.course import Course, causal_states
from identification.free_run import SPAN
from sim.rig import Rig
from sim.rig_motion import Moving

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

EVERY = 10  # rows, at which the inertia is taken


@numba.njit(cache=True)
def _moved(rows, length, angle, rate, torque, inertia, numbers, dt):
    """Angles (K, length); numbers: viscous, quadratic, coulomb, stiction, speed, stiffness, cubic, centre."""
    viscous, quadratic, coulomb, stiction, speed, stiffness, cubic, centre = numbers
    found = np.empty((len(rows), length))
    for k in range(len(rows)):
        q, v = angle[k], rate[k]
        for n in range(length):
            found[k, n] = q
            i = rows[k] + n
            off = q - centre
            damping = viscous + quadratic * abs(v)
            push = torque[i] - stiffness * off - cubic * off * off * off
            mass = inertia[i] + dt * damping
            v = (inertia[i] * v + dt * push) / mass
            # dry friction takes what rate is left, and no more
            most = dt * (coulomb + stiction * math.exp(-((v / speed) ** 2))) / mass
            v = v - most if v > most else (v + most if v < -most else 0.0)
            q += dt * v
    return found


class OneJoint:
    """A course of a rig, ready for runs of one joint."""

    def __init__(self, rig: Rig, course: Course, joint: str) -> None:
        """KeyError for a joint that the rig has not."""
        self.rig, self.course, self.joint = rig, course, joint
        self._index = {name: i for i, name in enumerate(rig.joints)}[joint]
        states = causal_states(course, SPAN)
        self._angle = states[:, self._index]
        self._rate = states[:, len(rig.joints) + self._index]
        self._known: tuple[tuple[float, ...], tuple[Floats, Floats]] | None = None

    def measured(self, rows: Rows, length: int) -> Floats:
        """Angles (K, length) [rad]."""
        return np.asarray(self.course.angles[rows[:, None] + np.arange(length), self._index])

    def run(self, rows: Rows, length: int, changes: Mapping[str, float]) -> Floats:
        """Angles (K, length) [rad] of free runs that start at `rows` (K,), from the measured past alone."""
        moving = Moving(self.rig, self.course.dt, changes)
        inertia, weight = self._bodies(moving)
        torque = moving.torques(self.course.inputs)[:, self._index] - weight
        stem, spring = f"terms.joint_friction.{self.joint}", f"terms.joint_stiffness.{self.joint}"
        numbers = [moving.values[f"{stem}.{n}"] for n in ("viscous", "quadratic", "coulomb", "stiction", "speed")]
        numbers += [moving.values[f"{spring}.{n}"] for n in ("stiffness", "cubic", "centre")]
        return np.asarray(
            _moved(
                rows, length, self._angle[rows], self._rate[rows], torque, inertia, np.array(numbers), self.course.dt
            )
        )

    def _bodies(self, moving: Moving) -> tuple[Floats, Floats]:
        """Inertia (N,) [kg m^2] of the joint and what gravity pulls at it (N,) [N m], the others as measured."""
        key = tuple(value for name, value in moving.values.items() if name.startswith("bodies."))
        if self._known is None or self._known[0] != key:
            model, data, i = moving.model, mujoco.MjData(moving.model), self._index
            rows = np.append(np.arange(0, len(self.course.angles) - 1, EVERY), len(self.course.angles) - 1)
            unit, taken, found = np.eye(model.nv)[i], np.zeros(model.nv), np.zeros((2, len(rows)))
            for n, row in enumerate(rows):
                data.qpos[:] = self.course.angles[row]
                mujoco.mj_fwdPosition(model, data)
                mujoco.mj_mulM(model, data, taken, unit)
                found[0, n] = taken[i]
                mujoco.mj_rne(model, data, 0, taken)
                found[1, n] = taken[i]
            every = np.arange(len(self.course.angles))
            self._known = key, (np.interp(every, rows, found[0]), np.interp(every, rows, found[1]))
        return self._known[1]
