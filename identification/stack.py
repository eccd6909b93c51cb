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

from identification.causes.contract import Change
from identification.drive import Driven, Noise
from identification.whitening import sensor_signatures

Floats = NDArray[np.float64]

WARM_UP = 1.0  # [s] at the start of a flight, when the filters do not know where they are


@dataclass(frozen=True, eq=False)
class Rows:
    """One flight: whitened residual and the signature of each parameter."""

    residual: Floats  # (R,)
    signatures: Mapping[str, Floats]  # by parameter, (R,)
    local: Floats  # (R, L) of what belongs to this flight alone
    local_std: Floats  # (L,)
    channel: NDArray[np.int64]  # (R,) of identification.channels
    t: Floats  # (R,)


def signatures(
    driven: Driven, noise: Noise, model: Mapping[str, Floats], changes: Mapping[str, Change]
) -> dict[str, Floats]:
    """Whitened signature (M + 7 N,) of every parameter of the model (N, 7), and of every change of measurements."""
    motion = driven.flight.motion
    nodes, scalars = len(motion.t), len(motion.kinds)
    keys = [*model, *changes]
    answer, measured = np.zeros((nodes, 7, len(keys))), np.zeros((nodes, 7, len(keys)))
    for c, slope in enumerate(model.values()):
        answer[:, :, c] = slope
    first = len(model)
    dz = np.zeros((scalars, len(changes)))
    df, dw = np.zeros((nodes, 3, len(changes))), np.zeros((nodes, 3, len(changes)))
    for c, change in enumerate(changes.values()):
        if change.scalars is not None:
            dz[:, c] = change.scalars
        if change.force is not None:
            df[:, :, c] = measured[:, :3, first + c] = change.force
        if change.rate is not None:
            dw[:, :, c] = measured[:, 3:6, first + c] = change.rate
        if change.rotor is not None:
            measured[:, 6, first + c] = change.rotor
    # a model that answers more would expect more: its signature is what its answer lacks
    below = driven.whiten(-answer, noise, measured).reshape(7 * nodes, len(keys))
    above = np.zeros((scalars, len(keys)))
    if changes:
        above[:, first:] = sensor_signatures(
            motion.way, motion.rows, motion.gains, motion.answers, motion.first, motion.step, motion.decay, dz, df, dw
        )
    whole = np.concatenate([above, below])
    return {key: whole[:, c] for c, key in enumerate(keys)}


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
        inner = np.eye(scaled.shape[1]) + scaled.T @ scaled
        factor = cho_factor(inner)
        cross, pull = scaled.T @ j, scaled.T @ item.residual
        information += j.T @ j - cross.T @ cho_solve(factor, cross)
        score += j.T @ item.residual - cross.T @ cho_solve(factor, pull)
        square += float(item.residual @ item.residual - pull @ cho_solve(factor, pull))
        log_local -= float(np.log(np.diag(factor[0])).sum())
        rows += int(np.count_nonzero(item.residual))
    return Stack(tuple(keys), information, score, square, log_local, rows)
