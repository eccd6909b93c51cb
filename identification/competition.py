"""Which cause explains best: every candidate on the same likelihood.

Under hypothesis h the parameters theta of its cause have a wide prior, all others the prior of their tolerance. The
evidence of a linear Gaussian model is closed:

    log p(r|h) = const + 1/2 b' (I + D G D)^-1 b' - 1/2 log |I + D G D|,   G = J^T J, b' = D J^T r, D = diag(std)

(Bishop, Pattern Recognition and Machine Learning, section 3.5).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from identification.causes.contract import Cause
from identification.stack import Stack

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Score:
    """One hypothesis: a set of causes."""

    causes: tuple[str, ...]
    log_evidence: float
    mean: Mapping[str, float]  # by key, change from nominal
    std: Mapping[str, float]
    fit: float  # log-likelihood gained at the best values, nuisances free within their priors

    @property
    def strength(self) -> float:
        """d': the distance that the cause's signature has from nothing, in standard deviations."""
        return float(np.sqrt(max(2.0 * self.fit, 0.0)))


class Competition:
    """All hypotheses on one stack."""

    def __init__(
        self,
        stack: Stack,
        tolerances: Mapping[str, float],
        causes: Sequence[Cause],
        spreads: Mapping[str, float],
        shift: Mapping[str, float] | None = None,
    ) -> None:
        """Hypotheses about one expansion point.

        tolerances: by key, what may be without any cause; spreads: by key, how large a cause may make it; shift: by
        key, where the expansion point stands from nominal.
        """
        at = np.array([(shift or {}).get(key, 0.0) for key in stack.keys])
        # r' = r + J m: the residual of the nominal model as this linear form has it
        stack = replace(
            stack, score=stack.score + stack.information @ at,
            square=stack.square + float(2.0 * at @ stack.score + at @ stack.information @ at),
        )  # fmt: skip
        self.stack = stack
        self.causes = {cause.name: cause for cause in causes}
        self._tolerance = np.array([tolerances.get(key, 0.0) for key in stack.keys])
        self._spreads = spreads
        self._null_gain = 0.0
        self.null = self._score(())

    def score(self, *names: str) -> Score:
        """The evidence of these causes together, over that of none."""
        return self._score(names)

    def singles(self) -> list[Score]:
        """Every cause alone, best first."""
        found = [self._score((name,)) for name in self.causes]
        return sorted(found, key=lambda score: -score.log_evidence)

    def pairs(self, names: Sequence[str]) -> list[Score]:
        """Every pair among these, best first."""
        found = [self._score(pair) for pair in combinations(names, 2)]
        return sorted(found, key=lambda score: -score.log_evidence)

    def _score(self, names: tuple[str, ...]) -> Score:
        std = self._tolerance.copy()
        own: list[int] = []
        for name in names:
            for parameter in self.causes[name].parameters:
                i = self.stack.keys.index(parameter.key)
                std[i] = self._spreads[parameter.key]
                own.append(i)
        used = np.flatnonzero(std > 0.0)
        d = std[used]
        g = d[:, None] * self.stack.information[np.ix_(used, used)] * d
        b = d * self.stack.score[used]
        factor = cho_factor(np.eye(len(used)) + g)
        solved = cho_solve(factor, b)
        gain = 0.5 * float(b @ solved)
        evidence = gain - float(np.log(np.diag(factor[0])).sum())
        evidence -= sum(float(np.log(self.causes[name].alike)) for name in names)
        covariance = d[:, None] * cho_solve(factor, np.diag(d))
        mean = d * solved
        base = 0.0 if not names else self.null.log_evidence
        fit = gain - (0.0 if not names else self._null_gain)
        if not names:
            self._null_gain = gain  # what tolerances alone explain
        place = {int(i): n for n, i in enumerate(used)}
        keys = self.stack.keys
        return Score(
            names,
            evidence - base if names else evidence,
            {keys[i]: float(mean[place[i]]) for i in (own if names else used.tolist())},
            {keys[i]: float(np.sqrt(covariance[place[i], place[i]])) for i in (own if names else used.tolist())},
            fit,
        )

    def likeness(self, a: str, b: str) -> float:
        """Cosine between two causes' signatures, what tolerances can imitate taken out; the closest directions."""
        used = np.flatnonzero(self._tolerance > 0.0)
        mine = [self.stack.keys.index(p.key) for p in self.causes[a].parameters]
        others = [self.stack.keys.index(p.key) for p in self.causes[b].parameters]
        free = [i for i in used if i not in mine and i not in others]
        d = self._tolerance[free]
        g = self.stack.information
        inner = cho_factor(np.eye(len(free)) + d[:, None] * g[free][:, free] * d)

        def left(x: list[int], y: list[int]) -> Floats:
            across = g[x][:, y]
            return np.asarray(across - (g[x][:, free] * d) @ cho_solve(inner, d[:, None] * g[free][:, y]))

        aa, bb, ab = left(mine, mine), left(others, others), left(mine, others)
        tiny = 1e-9
        aa += tiny * np.eye(len(mine)) * np.trace(aa)
        bb += tiny * np.eye(len(others)) * np.trace(bb)
        # canonical correlation: the largest singular value of aa^-1/2 ab bb^-1/2
        return float(np.sqrt(max(np.linalg.eigvals(np.linalg.solve(aa, ab) @ np.linalg.solve(bb, ab.T)).real.max(), 0)))


def posterior(scores: Sequence[Score], prior: float = 0.5) -> tuple[float, dict[str, float]]:
    """Probability of no cause, and of each of these; `prior` that there is any, shared out evenly."""
    logs = np.array([np.log(1.0 - prior), *(s.log_evidence + np.log(prior / max(len(scores), 1)) for s in scores)])
    share = np.exp(logs - logs.max())
    share /= share.sum()
    return float(share[0]), {"+".join(s.causes): float(p) for s, p in zip(scores, share[1:], strict=True)}
