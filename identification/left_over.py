"""What an explanation leaves of the flights' rows."""

import numpy as np
from numpy.typing import NDArray

from identification.bench import Bench
from identification.refit import Refit
from identification.stack import Rows

Floats = NDArray[np.float64]


def left_over(bench: Bench, fit: Refit) -> list[tuple[Rows, Floats]]:
    """Each flight's rows, and what of their residual is left at a refit's best values, nuisances taken out."""
    found = []
    for i in range(len(bench.names)):
        rows = bench.rows(i, fit.at)
        found.append((rows, rows.residual - explained(rows, fit)))
    return found


def explained(rows: Rows, fit: Refit) -> Floats:
    """(R,) what the step from a refit's last expansion point to its optimum, and what is local, take out."""
    residual = rows.residual.copy()
    for key, step in fit.step.items():
        residual -= rows.signatures[key] * step
    scaled = rows.local * rows.local_std
    solved = np.linalg.solve(np.eye(scaled.shape[1]) + scaled.T @ scaled, scaled.T @ residual)
    return np.asarray(rows.residual - residual + scaled @ solved)
