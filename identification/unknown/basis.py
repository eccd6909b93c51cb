"""Smooth curves over a driver: a few functions, from straight to wiggly, orthonormal over what was visited.

Natural cubic splines (Green and Silverman, Nonparametric Regression and Generalized Linear Models, section 2.3) in a
coordinate that runs half with the driver and half with the time spent there, in Demmler and Reinsch's order of growing
roughness. There is no constant among them: what a channel is off by everywhere is a bias.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

Floats = NDArray[np.float64]

KNOTS = 7
FUNCTIONS = KNOTS - 1
MESH = 201
FEWEST = 60  # rows
TAIL = 0.5  # [%] of the rows at either end, where a curve is held
LEAST = 1e-3  # of the driver's usual size that it must vary by


@dataclass(frozen=True, eq=False)
class Basis:
    """FUNCTIONS functions of one driver; beyond `low` and `high` they are held."""

    low: float
    high: float
    mesh: Floats  # (MESH,) of the driver
    values: Floats  # (MESH, FUNCTIONS)

    def __call__(self, x: Floats) -> Floats:
        """The functions (N, FUNCTIONS) at values (N,) of the driver."""
        return np.column_stack([np.interp(x, self.mesh, column) for column in self.values.T])


def basis(visited: Floats, near: float | None = None) -> Basis | None:
    """Functions over what was visited (N,); None where the driver stands still.

    near: [the driver's unit] finest scale at its zero, for one of which effects grow towards zero (a height).
    """
    x = visited[np.isfinite(visited)]
    if near is not None:
        x = np.maximum(x, 0.0)
    if len(x) < FEWEST:
        return None
    low, high = (float(v) for v in np.percentile(x, (TAIL, 100.0 - TAIL)))
    if high - low <= LEAST * max(abs(low), abs(high), 1e-12):
        return None
    bent = np.log(np.maximum(x, 0.0) + near) if near is not None else x
    ends = np.log(np.maximum([low, high], 0.0) + near) if near is not None else np.array([low, high])
    straight = np.clip((bent - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0)
    order = np.sort(straight)
    spent = np.searchsorted(order, straight) / len(x)
    where = 0.5 * (straight + spent)

    knots = np.linspace(0.0, 1.0, KNOTS)
    spline = CubicSpline(knots, np.eye(KNOTS), bc_type="natural")
    at = spline(where)
    at -= at.mean(axis=0)
    gram = at.T @ at / len(x)
    fine = np.linspace(0.0, 1.0, 12 * KNOTS)
    bend = spline(fine, 2)
    rough = bend.T @ bend / len(fine)
    # the constant has no weight and no roughness: left out by what the splines sum to
    free = np.linalg.svd(np.ones((1, KNOTS)))[2][1:].T
    try:
        _, best = eigh(free.T @ rough @ free, free.T @ gram @ free + 1e-9 * np.eye(FUNCTIONS))
    except np.linalg.LinAlgError:
        return None
    weights = free @ best
    mesh = np.linspace(float(ends[0]), float(ends[1]), MESH)
    if near is not None:
        mesh = np.exp(mesh) - near
    along = np.log(np.maximum(mesh, 0.0) + near) if near is not None else mesh
    share = np.clip((along - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0)
    values = spline(0.5 * (share + np.searchsorted(order, share) / len(x))) @ weights
    values -= (spline(where) @ weights).mean(axis=0)
    return Basis(low, high, mesh, values)
