"""Innovations of a rig's own model along a log, linear in what every number does to it.

Between two nodes, `h` apart, the model starts from the motion as smoothed; by how much it misses the next node (the
defect) is all that is nonlinear. What is left, e = truth less smoothed motion, follows

    e' = F e + d + G a h,    a' = phi a + w,    y = H e + v

with the defects d, the model's own transition F there, a disturbance a of each joint that remembers for MEMORY, and
white noise of the acceleration beside it. A Kalman filter whitens y; its gains do not depend on d, so that the effect
of a changed defect on the innovations is the same filter run over the change.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

Floats = NDArray[np.float64]

MEMORY = 1.5  # [s] of a disturbance
FIRST = 10.0  # times the noise of an angle: what the first state may be off
SETTLING = 4  # nodes at the start that count for nothing
KNOWN = 0.3  # of the logarithm of an angle's noise, about what the file says
ROOF = 6.0  # standard deviations, beyond which an innovation counts no more for the noise


@dataclass(frozen=True, eq=False)
class Linear:
    """One stretch about its smoothed motion, joints first, then rates."""

    h: float  # [s] from node to node
    transition: Floats  # (N, 2 J, 2 J) from each node to the next
    seen: Floats  # (N + 1, J) [rad] measured less smoothed angle at the nodes


@dataclass(frozen=True, eq=False)
class Noise:
    """What is random, by joint."""

    angle: Floats  # (J,) [rad] of one row
    slow: Floats  # (J,) [rad/s^2] of the disturbance that remembers
    white: Floats  # (J,) [rad/s^1.5] of the one that does not


@numba.njit(cache=True)
def _filtered(transition, seen, defects, h, angle, slow, white, first, first_rate, memory):
    """Whitened innovations (N, J, C) of C columns of defects (N, 2 J, C); sum of logs of their deviations.

    `seen` belongs to the first column; angle (J,): variance at a node.
    """
    nodes, joints, columns = len(seen), seen.shape[1], defects.shape[2]
    size = 3 * joints
    phi = np.exp(-h / memory)
    covariance = np.zeros((size, size))
    for j in range(joints):
        covariance[j, j] = first[j] ** 2
        covariance[joints + j, joints + j] = first_rate[j] ** 2
        covariance[2 * joints + j, 2 * joints + j] = slow[j] ** 2
    state = np.zeros((size, columns))
    found = np.zeros((nodes, joints, columns))
    logs = 0.0
    f = np.zeros((size, size))
    gain = np.zeros(size)
    moved = np.zeros((size, columns))
    push = np.zeros((joints, 2 * joints))
    for n in range(nodes):
        if n > 0:
            f[:] = 0.0
            for i in range(2 * joints):
                for k in range(2 * joints):
                    f[i, k] = transition[n - 1, i, k]
            for j in range(joints):
                # half of an acceleration acts before, half after the model's own transition: what holds, holds
                for i in range(2 * joints):
                    push[j, i] = 0.5 * transition[n - 1, i, joints + j]
                push[j, joints + j] += 0.5
                for i in range(2 * joints):
                    f[i, 2 * joints + j] = h * push[j, i]
                f[2 * joints + j, 2 * joints + j] = phi
            covariance = f @ covariance @ f.T
            for j in range(joints):
                covariance[2 * joints + j, 2 * joints + j] += slow[j] ** 2 * (1.0 - phi * phi)
                for i in range(2 * joints):
                    for k in range(2 * joints):
                        covariance[i, k] += white[j] ** 2 * h * push[j, i] * push[j, k]
            moved[:] = 0.0
            for i in range(size):
                for k in range(size):
                    if f[i, k] != 0.0:
                        for c in range(columns):
                            moved[i, c] += f[i, k] * state[k, c]
            for i in range(2 * joints):
                for c in range(columns):
                    moved[i, c] += defects[n - 1, i, c]
            state[:] = moved
        for j in range(joints):
            variance = covariance[j, j] + angle[j]
            std = np.sqrt(variance)
            logs += np.log(std)
            for i in range(size):
                gain[i] = covariance[i, j] / variance
            for c in range(columns):
                left = (seen[n, j] if c == 0 else 0.0) - state[j, c]
                found[n, j, c] = left / std
                for i in range(size):
                    state[i, c] += gain[i] * left
            for i in range(size):
                for k in range(size):
                    covariance[i, k] -= gain[i] * gain[k] * variance
    return found, logs


def innovations(linear: Linear, noise: Noise, defects: Floats) -> tuple[Floats, float]:
    """Whitened innovations (N + 1, J, C) of defects (N, 2 J, C), and the sum of the logs of their deviations.

    The first column is the model's, with what was measured; the others are changes of it.
    """
    rate = np.full(len(noise.angle), 1.0)
    found, logs = _filtered(
        linear.transition, linear.seen, np.ascontiguousarray(defects), linear.h, noise.angle**2,
        noise.slow, noise.white, FIRST * noise.angle, rate, MEMORY,
    )  # fmt: skip
    found[:SETTLING] = 0.0
    return found, float(logs)


def fit_noise(parts: list[tuple[Linear, Floats]], start: Noise, least: Floats) -> Noise:
    """The most likely noise for these stretches, each with the defects (N, 2 J) of the best model.

    least (J,) [rad/s^2]: of the disturbance that remembers; no model is perfect.
    """
    joints = len(start.angle)

    def noise(x: Floats) -> Noise:
        angle, slow, white = np.exp(x.reshape(3, joints))
        return Noise(angle, slow, white)

    x0 = np.log(np.concatenate([start.angle, start.slow, start.white]))

    def cost(x: Floats) -> float:
        total = 0.0
        for linear, defects in parts:
            z, logs = innovations(linear, noise(x), defects[..., None])
            square = z**2
            total += logs + 0.5 * float(np.minimum(square, ROOF**2).sum())
        return total + 0.5 * float((((x - x0) / width) ** 2).sum())

    width = np.repeat([KNOWN, 3.0, 3.0], joints)
    low = x0 - 3.0 * width
    low[joints : 2 * joints] = np.log(least)
    bounds = list(zip(low, np.maximum(x0, low) + 3.0 * width, strict=True))
    found = minimize(cost, np.maximum(x0, low), method="L-BFGS-B", options={"maxiter": 40}, bounds=bounds)
    return noise(np.asarray(found.x))
