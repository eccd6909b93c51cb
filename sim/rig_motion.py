"""A rig moved by its inputs: many runs at once, from given states, by MuJoCo.

What inputs do depends on the inputs alone, so torques are known before any run; friction without stiction, springs
and the mechanism are MuJoCo's own, and all runs go through `mujoco.rollout`.
"""

import copy
import math
from collections.abc import Mapping

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray
from scipy.signal import lfilter

from sim.rig import Rig

Floats = NDArray[np.float64]

LONGEST_STEP = 0.01  # [s]
SHARED = 4000  # torques, from which on two threads share the runs


class Moving:
    """A rig with its numbers put in, ready to run."""

    def __init__(
        self, rig: Rig, dt: float, changes: Mapping[str, float] | None = None, longest: float = LONGEST_STEP
    ) -> None:
        """`dt` [s]: between two rows of inputs and of states; changes: numbers that are not the rig's own.

        longest [s]: of the steps between; what drives the joints acts half of one early.
        """
        self.rig, self.dt = rig, dt
        self.values = rig.values(changes)
        self.substeps = max(1, math.ceil(dt / longest - 1e-9))
        self.model = self._model()
        self._data = [mujoco.MjData(self.model) for _ in range(2)]
        term = "terms.joint_friction"
        self._stiction = np.array([self.values[f"{term}.{joint}.stiction"] for joint in rig.joints])
        self._speed = np.array([self.values[f"{term}.{joint}.speed"] for joint in rig.joints])

    def torques(self, inputs: Floats) -> Floats:
        """Torque (N, J) [N m] on the joints along a log of inputs (N, I), `dt` apart.

        Before the first row the inputs had always been what they are there.
        """
        found = np.zeros((len(inputs), len(self.rig.joints)))
        for i, name in enumerate(self.rig.inputs):
            u = self._late(inputs[:, i], name)
            key = f"terms.input_nonlinearity.{name}"
            deadband, exponent = self.values[f"{key}.deadband"], self.values[f"{key}.exponent"]
            if deadband > 0.0 or exponent != 1.0:
                u = np.sign(u) * np.maximum(np.abs(u) - deadband, 0.0) ** exponent
            for j, joint in enumerate(self.rig.joints):
                found[:, j] += self.values.get(f"inputs.{name}.torque.{joint}", 0.0) * u
        return found

    def run(self, start: Floats, torques: Floats) -> Floats:
        """States (K, T, 2 J), angles [rad] and rates [rad/s], of K runs.

        start (K, 2 J): at the first row; torques (K, T, J): row n acts from there to row n + 1.
        """
        if not len(start):
            return np.zeros((0, torques.shape[1], start.shape[1]))
        if np.any(self._stiction > 0.0):
            return np.stack([self._step_by_step(s, t) for s, t in zip(start, torques, strict=True)])
        acting = np.repeat(torques[:, :-1], self.substeps, axis=1)
        first = np.concatenate([np.zeros((len(start), 1)), start], axis=1)
        if acting.shape[1] == 0:
            return np.asarray(start[:, None])
        states, _ = rollout.rollout(
            self.model, self._data[: 2 if acting.size > SHARED else 1], first, np.ascontiguousarray(acting),
            control_spec=int(mujoco.mjtState.mjSTATE_QFRC_APPLIED),
        )  # fmt: skip
        kept = states[:, self.substeps - 1 :: self.substeps, 1 : 1 + start.shape[1]]
        return np.concatenate([start[:, None], kept], axis=1)

    def inverse(self, angles: Floats, rates: Floats, accelerations: Floats) -> Floats:
        """Torque (N, J) that the motion (each (N, J)) takes, all but the inputs' and dry friction's accounted for."""
        data = mujoco.MjData(self.model)
        found = np.empty_like(angles)
        model = copy.copy(self.model)
        model.dof_frictionloss[:] = 0.0
        for n in range(len(angles)):
            data.qpos[:], data.qvel[:], data.qacc[:] = angles[n], rates[n], accelerations[n]
            mujoco.mj_inverse(model, data)
            found[n] = data.qfrc_inverse
        return found

    def _late(self, u: Floats, name: str) -> Floats:
        tau, delay = (self.values[f"terms.actuator_lag.{name}.{p}"] for p in ("tau", "delay"))
        if delay > 0.0:
            rows = np.arange(len(u))
            u = np.interp(rows - delay / self.dt, rows, u)
        if tau > 0.0:
            left = math.exp(-self.dt / tau)
            # the mean over the row that follows, held input: what the run takes as constant there
            share = tau / self.dt * (1.0 - left)
            lagged, _ = lfilter([0.0, 1.0 - left], [1.0, -left], u, zi=[u[0]])
            u = u + (lagged - u) * share
        return u

    def _model(self) -> mujoco.MjModel:
        model = copy.copy(self.rig.model)
        model.opt.timestep = self.dt / self.substeps
        for key, value in self.values.items():
            section, name, what, *axis = key.split(".")
            if section == "bodies":
                body = model.body(name)
                if what == "mass":
                    body.mass[0] = value
                elif what == "centre":
                    body.ipos[int(axis[0])] = value
                else:
                    body.inertia[int(axis[0])] = value
        for i, joint in enumerate(self.rig.joints):
            model.dof_damping[i] += self.values[f"terms.joint_friction.{joint}.viscous"]
            model.dof_dampingpoly[i, 0] = self.values[f"terms.joint_friction.{joint}.quadratic"]
            model.dof_frictionloss[i] += self.values[f"terms.joint_friction.{joint}.coulomb"]
            stiffness, cubic, centre = (
                self.values[f"terms.joint_stiffness.{joint}.{name}"] for name in ("stiffness", "cubic", "centre")
            )
            if stiffness > 0.0 or cubic > 0.0:
                model.jnt_stiffness[i], model.jnt_stiffnesspoly[i, 1] = stiffness, cubic
                model.qpos_spring[i] = centre
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return model

    def _step_by_step(self, start: Floats, torques: Floats) -> Floats:
        """One run whose dry friction depends on the rate."""
        model, data = copy.copy(self.model), mujoco.MjData(self.model)
        n = len(self.rig.joints)
        coulomb = self.model.dof_frictionloss.copy()
        data.qpos[:], data.qvel[:] = start[:n], start[n:]
        found = np.empty((len(torques), 2 * n))
        for row, torque in enumerate(torques):
            found[row, :n], found[row, n:] = data.qpos, data.qvel
            data.qfrc_applied[:] = torque
            for _ in range(self.substeps):
                model.dof_frictionloss[:] = coulomb + self._stiction * np.exp(-((data.qvel / self._speed) ** 2))
                mujoco.mj_step(model, data)
        return found
