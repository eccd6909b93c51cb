"""The filters of Zeng and Jiang as published: attitude from rates and plumb line, velocity from force and flow.

Both are complementary: integrals of the inertial sensors, drawn back slowly, by a proportional and an integral part, to
what another sensor says. The paper's equation 4 is lost; its reading is the usual one. Neither has a covariance.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightlog.constants import GRAVITY
from flightlog.rotations import matrix

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ComplementaryGains:
    """The paper gives none: a plumb line that acts over some seconds, flow that acts over one."""

    smoothing: float = 0.1  # [s] of the accelerometer's low-pass
    level: float = 0.4  # [1/s] proportional
    level_integral: float = 0.04  # [1/s^2]
    velocity: float = 3.0  # [1/s] k_p of equation 4: damping 1 at 1.5 rad/s
    velocity_integral: float = 2.25  # [1/s^2] k_i


class PlumbLineAttitude:
    """Attitude: e = a x g(q) by a PI regulator onto the rates, quaternion by a first-order step (a Mahony filter)."""

    def __init__(self, gains: ComplementaryGains, quaternion: Floats) -> None:
        """Begins with an attitude (4,) wxyz, body to world."""
        self._gains = gains
        self.quaternion = quaternion.copy()
        self._force = matrix(quaternion).T @ np.array([0.0, 0.0, GRAVITY])
        self._integral = np.zeros(3)

    def step(self, force: Floats, rates: Floats, dt: float) -> None:
        """One sample: specific force (3,) [m/s^2] and rates (3,) [rad/s] in body axes, `dt` [s] after the last."""
        gains = self._gains
        self._force += min(1.0, dt / gains.smoothing) * (force - self._force)
        # what the plumb line says is up, against what the attitude says
        up, size = matrix(self.quaternion)[2], math.sqrt(float(self._force @ self._force))
        (a0, a1, a2), (g0, g1, g2) = (self._force / max(size, 1e-6)).tolist(), up.tolist()
        error = np.array([a1 * g2 - a2 * g1, a2 * g0 - a0 * g2, a0 * g1 - a1 * g0])
        self._integral += gains.level_integral * dt * error
        x, y, z = (rates + gains.level * error + self._integral).tolist()
        w0, q0, q1, q2 = self.quaternion.tolist()
        turned = self.quaternion + 0.5 * dt * np.array(
            [-q0 * x - q1 * y - q2 * z, w0 * x + q1 * z - q2 * y, w0 * y + q2 * x - q0 * z, w0 * z + q0 * y - q1 * x]
        )
        self.quaternion = turned / math.sqrt(float(turned @ turned))


class FlowVelocity:
    """Equation 4, read as v' = a + k_p e + k_i integral of e with e = v_flow - v, and p' = v; (2,) each, ENU."""

    def __init__(self, gains: ComplementaryGains) -> None:
        """Begins at rest at the origin."""
        self._gains = gains
        self.position = np.zeros(2)  # [m]
        self.velocity = np.zeros(2)  # [m/s]
        self._error = np.zeros(2)  # [m/s] as of the last flow
        self._integral = np.zeros(2)  # [m]

    def flow(self, velocity: Floats, dt: float) -> None:
        """A velocity (2,) [m/s] by flow, `dt` [s] after the last; it acts until the next comes."""
        self._error = velocity - self.velocity
        self._integral += dt * self._error

    def lost(self) -> None:
        """Flow has failed: the inertial sensors alone."""
        self._error = np.zeros(2)

    def step(self, acceleration: Floats, dt: float) -> None:
        """Acceleration (2,) [m/s^2] over the last `dt` [s]."""
        gains = self._gains
        rate = acceleration + gains.velocity * self._error + gains.velocity_integral * self._integral
        self.velocity = self.velocity + dt * rate
        self.position = self.position + dt * self.velocity
