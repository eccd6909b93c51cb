"""A cause fitted for good: Levenberg and Marquardt's iteration to its own best values, and the evidence there.

The prior of a parameter stands about its nominal value; expanded about another point m it is met by moving the
residual back along the signatures: r' = r(m) + J (m - nominal).
"""

import os
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from identification.bench import Bench
from identification.causes.contract import Cause
from identification.stack import Rows, Stack, stack

Floats = NDArray[np.float64]

ROUNDS = 12
MOVED = 0.5  # of a prior's standard deviation, beyond which a signature is taken anew
GAINED = 0.1  # nats that a round must promise
RENEWALS = 1  # of slopes, in one fit, each costs as much as ten rounds
DAMPING = 0.3  # of the priors' precision, to begin with where a step went too far
STIFFEST = 1e4  # damping beyond which there is no way down


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


def _rows(bench: Bench, which: Sequence[int], at: Mapping[str, float], fresh: Collection[str]) -> list[Rows]:
    """Every flight's rows; side by side where the bench's flights do not share what they write."""
    if not getattr(bench, "apart", False):
        return [bench.rows(i, at, fresh) for i in which]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(lambda i: bench.rows(i, at, fresh), which))


@dataclass(frozen=True, eq=False)
class _Point:
    """Where the iteration stands; std, shift (K,) in the order of the stack's keys."""

    at: dict[str, float]
    cost: float
    stack: Stack
    std: Floats
    shift: Floats


def _step(s: Stack, std: Floats, shift: Floats, damping: float) -> tuple[Floats, float]:
    """(K,) from an expansion point towards the optimum, and the nats that it promises.

    Damped in the priors' own units: (D G D + (1 + damping) I) y = D g - m / D, the step being D y.
    """
    used = np.flatnonzero(std > 0.0)
    d = std[used]
    g = d[:, None] * s.information[np.ix_(used, used)] * d
    pull = d * s.score[used] - shift[used] / d
    y = cho_solve(cho_factor(g + (1.0 + damping) * np.eye(len(used))), pull)
    step = np.zeros(len(std))
    step[used] = d * y
    return step, float(pull @ y - 0.5 * y @ (g @ y + y))


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

    No causes: the null. The causes' own signatures are taken anew where they moved by more than MOVED of their priors;
    for the rest the chord serves until it misleads: where a step went too far, a bench that can (`renew`) takes all of
    them anew at the best point so far before steps are damped.
    """
    which = range(len(bench.names)) if flights is None else flights
    own = [p.key for cause in causes for p in cause.parameters]
    prior = dict(bench.tolerances) | {key: bench.spreads[key] for key in own}
    prior = {key: std for key, std in prior.items() if std > 0.0}
    at = {key: value for key, value in (start or {}).items() if key in prior}
    anew = list(prior) if getattr(bench, "cheap", False) else own  # what slopes are taken anew of
    renew = getattr(bench, "renew", None)
    if renew:
        renew(None)

    def expand(at: dict[str, float], fresh: Collection[str] = ()) -> _Point:
        rows = _rows(bench, which, at, fresh)
        s = stack(rows, list(rows[0].signatures))
        std = np.array([prior.get(key, 0.0) for key in s.keys])
        shift = np.array([at[key] - bench.nominal[key] if key in at else 0.0 for key in s.keys])
        return _Point(at, _cost(s, std, shift), s, std, shift)

    best, damping, renewed = expand(at, set(anew) & set(at)), 0.0, 0
    for _ in range(rounds - 1):
        step, promised = _step(best.stack, best.std, best.shift, damping)
        if promised < GAINED or damping > STIFFEST:
            break
        moves = dict(zip(best.stack.keys, step.tolist(), strict=True))
        at = {key: bench.bounded(key, best.at.get(key, bench.nominal[key]) + moves[key]) for key in prior}
        here = expand(at, {key for key in anew if abs(moves[key]) > MOVED * prior[key]})
        if here.cost < best.cost:
            best, damping = here, 0.0 if damping < DAMPING else 0.2 * damping
        elif renew and renewed < RENEWALS:
            renew(best.at)
            best, renewed = expand(best.at), renewed + 1
        else:
            damping = max(DAMPING, 5.0 * damping)
    s, where = best.stack, best.at
    solved = _solve(s, best.std, best.shift, s.index(list(prior)))
    # what the last line promises and nobody saw does not count
    unseen = max(best.cost - solved.cost, 0.0)
    if unseen > GAINED:
        solved = replace(solved, step=dict.fromkeys(solved.step, 0.0))
    else:
        unseen = 0.0
    reached = {key: where.get(key, bench.nominal[key]) + solved.step[key] for key in prior}
    chosen = [list(prior).index(key) for key in own]
    return Refit(
        causes=tuple(c.name for c in causes),
        values={key: reached[key] for key in own},
        std={key: solved.std[key] for key in own},
        log_evidence=solved.log_evidence - unseen - sum(float(np.log(cause.alike)) for cause in causes),
        cost=solved.cost + unseen,
        covariance=solved.covariance[np.ix_(chosen, chosen)],
        at=where,
        step=solved.step,
        stack=s,
    )


def linear_cost(bench: Bench, at: Mapping[str, float]) -> float:
    """Half the square that is left at these values (absolute, by key), what has a tolerance free on the last slopes."""
    rows = _rows(bench, range(len(bench.names)), at, ())
    s = stack(rows, list(rows[0].signatures))
    std = np.array([bench.tolerances.get(key, 0.0) for key in s.keys])
    free = [key in at and deviation > 0.0 for key, deviation in zip(s.keys, std, strict=True)]
    shift = np.array([at[key] - bench.nominal[key] if own else 0.0 for key, own in zip(s.keys, free, strict=True)])
    return _solve(s, std, shift, []).cost


def _cost(s: Stack, std: Floats, shift: Floats) -> float:
    """Half the square of the residual as it is, and of what was spent of the priors."""
    spent = shift[std > 0.0] / std[std > 0.0]
    return 0.5 * (s.square + float(spent @ spent))
