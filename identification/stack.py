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

from identification.signatures import Signatures

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
    square: Floats | None = None  # (K + L, K + L) products of all columns, signatures first, where they are kept

    @property
    def at(self) -> Floats:
        """(L,) the same, zeros where nothing."""
        return np.zeros(len(self.local_std)) if self.local_at is None else self.local_at

    def products(self, keys: Sequence[str]) -> tuple[Floats, Floats]:
        """(K + L, K + L) products of these signatures and what is local, and (K + L,) theirs with the residual.

        The prior of what is local stands about nothing: as if the residual had been taken there.
        """
        residual = self.residual + self.local @ self.at
        if self.square is not None and isinstance(self.signatures, Signatures):
            pull = np.concatenate([self.signatures.matrix.T @ residual, self.local.T @ residual])
            if self.signatures.names == tuple(keys):
                return self.square, pull
            own = len(self.signatures)
            which = [self.signatures.names.index(key) for key in keys] + list(range(own, len(pull)))
            return self.square[np.ix_(which, which)], pull[which]
        whole = np.column_stack([*(self.signatures[key] for key in keys), self.local])
        return np.asarray(whole.T @ whole), np.asarray(whole.T @ residual)


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
        residual = item.residual + item.local @ item.at
        products, pulls = item.products(keys)
        d = item.local_std
        factor = cho_factor(np.eye(len(d)) + d[:, None] * products[k:, k:] * d)
        cross, pull = d[:, None] * products[k:, :k], d * pulls[k:]
        information += products[:k, :k] - cross.T @ cho_solve(factor, cross)
        score += pulls[:k] - cross.T @ cho_solve(factor, pull)
        square += float(residual @ residual - pull @ cho_solve(factor, pull))
        log_local -= float(np.log(np.diag(factor[0])).sum())
        rows += int(np.count_nonzero(item.residual))
    return Stack(tuple(keys), information, score, square, log_local, rows)
