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

ROUNDS = 10
STEP_LIMIT = 2.0  # of the prior's standard deviation that one step may go
MOVED = 0.3  # of it, beyond which a signature is taken anew
GAINED = 0.1  # nats that a round must gain
SMALLEST_SHARE = 0.05  # of a step


@dataclass(frozen=True, eq=False)
class Refit:
    """Causes at their best values."""

    causes: tuple[str, ...]
    values: Mapping[str, float]  # absolute, by key
    std: Mapping[str, float]
    log_evidence: float  # of the data, without the constant that all hypotheses share
    cost: float  # half the residual's square, nuisances free within their priors
    covariance: Floats  # (P, P) of the causes' parameters in the order of `values`
    at: Mapping[str, float]  # where the model was last linearised: absolute, by key, what is not nominal
    step: Mapping[str, float]  # from there to the best values, by key
    stack: Stack  # there


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
    rounds: int = ROUNDS,
) -> Refit:
    """Fit these causes together, everything that has a tolerance with them; `start`: absolute values to begin at.

    No causes: the null. Signatures are taken anew for what has moved by more than MOVED of its prior; for the rest the
    chord serves.
    """
    which = range(len(bench.names)) if flights is None else flights
    own = [p.key for cause in causes for p in cause.parameters]
    prior = dict(bench.tolerances) | {key: bench.spreads[key] for key in own}
    prior = {key: std for key, std in prior.items() if std > 0.0}
    at = dict(start or {})
    fresh: set[str] = {key for key in at if key in prior}
    best: tuple[dict[str, float], _Solved, Stack, float] | None = None
    share = 1.0
    for _ in range(rounds):
        rows = [bench.rows(i, at, fresh) for i in which]
        s = stack(rows, list(rows[0].signatures))
        std = np.array([prior.get(key, 0.0) for key in s.keys])
        shift = np.array([at[key] - bench.nominal[key] if key in at else 0.0 for key in s.keys])
        here = _cost(s, std, shift)
        fresh = set()
        if best is not None and here > best[3] - GAINED:
            if share < SMALLEST_SHARE or here < best[3] + GAINED:
                break
            share *= 0.3  # too far for a straight line
        else:
            best = dict(at), _solve(s, std, shift, s.index(list(prior))), s, here
            share = min(1.0, 2.0 * share)
        where, solved = best[0], best[1]
        at = {}
        for key, width in prior.items():
            step = share * float(np.clip(solved.step[key], -STEP_LIMIT * width, STEP_LIMIT * width))
            at[key] = bench.bounded(key, where.get(key, bench.nominal[key]) + step)
            if abs(step) > MOVED * width:
                fresh.add(key)
    assert best is not None
    where, solved, s, _ = best
    reached = {key: where.get(key, bench.nominal[key]) + solved.step[key] for key in prior}
    chosen = [list(prior).index(key) for key in own]
    return Refit(
        causes=tuple(c.name for c in causes),
        values={key: reached[key] for key in own},
        std={key: solved.std[key] for key in own},
        log_evidence=solved.log_evidence - sum(float(np.log(cause.alike)) for cause in causes),
        cost=solved.cost,
        covariance=solved.covariance[np.ix_(chosen, chosen)],
        at=where,
        step=solved.step,
        stack=s,
    )


def _cost(s: Stack, std: Floats, shift: Floats) -> float:
    """Half the square of the residual as it is, and of what was spent of the priors."""
    spent = shift[std > 0.0] / std[std > 0.0]
    return 0.5 * (s.square + float(spent @ spent))
