"""Where one explanation beats another: the channel, and the part of the flights, in which the evidence accrues."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification.bench import Bench
from identification.refit import Refit
from identification.search import Names, Search
from identification.stack import Rows
from identification.verdict import LostBecause

Floats = NDArray[np.float64]

BANDS = 4  # into which each driver is cut, with equally many rows


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


def lost(search: Search, best: Names, loser: str) -> LostBecause | None:
    """Why the set `best` beats the best that the loser can do in its place."""
    return None


def bands(values: Floats, count: int = BANDS) -> Sequence[tuple[float, float]]:
    """Cut a driver's range into bands with equally many rows."""
    edges = np.quantile(values, np.linspace(0.0, 1.0, count + 1))
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
