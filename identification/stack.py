"""All flights in one linear form: whitened innovations and what every parameter does to them.

    r = J theta + e,   e ~ N(0, 1)

Kept as J^T J, J^T r and r^T r. What belongs to one flight alone (its wind, its sensor's bias) has a prior and is
eliminated flight by flight.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Rows:
    """One flight: whitened residual and the signature of each parameter."""

    residual: Floats  # (R,)
    signatures: Mapping[str, Floats]  # by parameter, (R,)
    local: Floats  # (R, L) of what belongs to this flight alone
    local_std: Floats  # (L,)
    channel: NDArray[np.int64]  # (R,) of identification.channels
    t: Floats  # (R,)
    local_at: Floats | None = None  # (L,) of the local ones, where the residual was taken; None: nothing

    @property
    def at(self) -> Floats:
        """(L,) the same, zeros where nothing."""
        return np.zeros(len(self.local_std)) if self.local_at is None else self.local_at


@dataclass(frozen=True, eq=False)
class Stack:
    """Information about all parameters, all flights together, what is local eliminated."""

    keys: tuple[str, ...]
    information: Floats  # (K, K)
    score: Floats  # (K,)
    square: float  # r^T r, what local unknowns explain taken out
    log_local: float  # -1/2 log |I + P G| of the locals
    rows: int

    def index(self, keys: Sequence[str]) -> list[int]:
        """Where these parameters stand."""
        return [self.keys.index(key) for key in keys]


def stack(flights: Sequence[Rows], keys: Sequence[str]) -> Stack:
    """Sum over the flights."""
    k = len(keys)
    information, score = np.zeros((k, k)), np.zeros(k)
    square, log_local, rows = 0.0, 0.0, 0
    for item in flights:
        j = np.column_stack([item.signatures[key] for key in keys])
        scaled = item.local * item.local_std
        # the prior of the local ones stands about nothing: as if the residual had been taken there
        residual = item.residual + item.local @ item.at
        inner = np.eye(scaled.shape[1]) + scaled.T @ scaled
        factor = cho_factor(inner)
        cross, pull = scaled.T @ j, scaled.T @ residual
        information += j.T @ j - cross.T @ cho_solve(factor, cross)
        score += j.T @ residual - cross.T @ cho_solve(factor, pull)
        square += float(residual @ residual - pull @ cho_solve(factor, pull))
        log_local -= float(np.log(np.diag(factor[0])).sum())
        rows += int(np.count_nonzero(item.residual))
    return Stack(tuple(keys), information, score, square, log_local, rows)
