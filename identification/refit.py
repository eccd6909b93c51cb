"""A cause fitted for good: Gauss-Newton about its own best values, and the evidence there.

The prior of a parameter stands about its nominal value; expanded about another point m it is met by moving the
residual back along the signatures: r' = r(m) + J (m - nominal).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from identification.bench import Bench
from identification.causes.contract import Cause
from identification.stack import Stack, stack

Floats = NDArray[np.float64]

ROUNDS = 6
STEP_LIMIT = 2.0  # spreads that one step may go
SETTLED = 0.02  # standard deviations


@dataclass(frozen=True, eq=False)
class Refit:
    """Causes at their best values."""

    causes: tuple[str, ...]
    values: Mapping[str, float]  # absolute, by key
    std: Mapping[str, float]
    log_evidence: float  # of the data, without the constant that all hypotheses share
    cost: float  # half the residual's square, nuisances free within their priors
    covariance: Floats  # (P, P) of the causes' parameters in the order of `values`


@dataclass(frozen=True, eq=False)
class _Solved:
    log_evidence: float
    cost: float
    step: dict[str, float]
    std: dict[str, float]
    covariance: Floats


def _solve(s: Stack, std: Floats, shift: Floats, own: list[int]) -> _Solved:
    """Everything in closed form about one expansion point; shift (K,): its distance from nominal."""
    used = np.flatnonzero(std > 0.0)
    d, m = std[used], shift[used]
    information, score = s.information[np.ix_(used, used)], s.score[used]
    square = s.square + 2.0 * m @ score + m @ information @ m
    b = d * (score + information @ m)
    factor = cho_factor(np.eye(len(used)) + d[:, None] * information * d)
    solved = cho_solve(factor, b)
    covariance = d[:, None] * cho_solve(factor, np.diag(d))
    cost = 0.5 * float(square - b @ solved)
    evidence = s.log_local - cost - float(np.log(np.diag(factor[0])).sum())
    best = d * solved - m  # from the expansion point
    where = [int(np.flatnonzero(used == i)[0]) for i in own]
    return _Solved(
        evidence, cost, {s.keys[i]: float(best[w]) for i, w in zip(own, where, strict=True)},
        {s.keys[i]: float(np.sqrt(covariance[w, w])) for i, w in zip(own, where, strict=True)},
        covariance[np.ix_(where, where)],
    )  # fmt: skip


def refit(
    bench: Bench,
    causes: Sequence[Cause],
    start: Mapping[str, float] | None = None,
    flights: Sequence[int] | None = None,
) -> Refit:
    """Fit these causes together, tolerances and each flight's own unknowns free; `start`: absolute values."""
    which = range(len(bench.names)) if flights is None else flights
    own_keys = [p.key for cause in causes for p in cause.parameters]
    at = {key: bench.nominal[key] for key in own_keys} | dict(start or {})
    spread = {key: bench.spreads[key] for key in own_keys}
    found: _Solved | None = None
    best: tuple[dict[str, float], _Solved] | None = None
    for _ in range(ROUNDS if causes else 1):
        rows = [bench.rows(i, at) for i in which]
        s = stack(rows, list(rows[0].signatures))
        std = np.array([spread.get(key, bench.tolerances.get(key, 0.0)) for key in s.keys])
        shift = np.array([at[key] - bench.nominal[key] if key in at else 0.0 for key in s.keys])
        found = _solve(s, std, shift, s.index(own_keys))
        if best is None or found.log_evidence > best[1].log_evidence:
            best = dict(at), found
        moved = 0.0
        for key in own_keys:
            step = float(np.clip(found.step[key], -STEP_LIMIT * spread[key], STEP_LIMIT * spread[key]))
            moved = max(moved, abs(step) / max(found.std[key], 1e-12))
            at[key] += step
        if moved < SETTLED:
            break
    assert best is not None
    where, solved = best
    values = {key: where[key] + solved.step[key] for key in own_keys}
    return Refit(
        tuple(c.name for c in causes), values, solved.std, solved.log_evidence, solved.cost, solved.covariance
    )  # fmt: skip
