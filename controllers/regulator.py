"""Linear-quadratic regulators, and the reduction of a model to the states that a loop needs.

scipy's Riccati solvers do what `control.lqr` and `control.dlqr` do (which call them), without the 1.6 s that
importing control takes before a flight; a test holds both equal.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_are, solve_discrete_are

Floats = NDArray[np.float64]


def lqr(a: Floats, b: Floats, q: Floats, r: Floats) -> Floats:
    """Gain K (m, n) of u = -K x for dx/dt = a x + b u, least integral of x'q x + u'r u."""
    return np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q, r))


def dlqr(a: Floats, b: Floats, q: Floats, r: Floats) -> Floats:
    """Gain K (m, n) of u = -K x for x(k+1) = a x + b u, least sum of x'q x + u'r u."""
    p = solve_discrete_are(a, b, q, r)
    return np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)


def bryson(*largest: float) -> Floats:
    """Diagonal weights 1/largest^2: Bryson's rule, each entry the largest value that is welcome."""
    return np.diag(1.0 / np.square(largest))


def residualise(a: Floats, b: Floats, keep: Sequence[int], fast: Sequence[int]) -> tuple[Floats, Floats]:
    """The model of the states `keep`, those of `fast` taken at rest; all others held at zero."""
    fast = list(fast)
    keep = list(keep)
    if not fast:
        return a[np.ix_(keep, keep)], b[keep]
    rest = np.linalg.solve(a[np.ix_(fast, fast)], np.hstack([a[np.ix_(fast, keep)], b[fast]]))
    coupling = a[np.ix_(keep, fast)] @ rest
    return a[np.ix_(keep, keep)] - coupling[:, : len(keep)], b[keep] - coupling[:, len(keep) :]
