"""A closed form for a curve: one or two members of a small library, chosen in the flights' own likelihood.

Every member is held against the same rows as the curve was, everything else that is free taken out; all sets of one
and of two are compared by Schwarz's criterion. The constant is not in the library: it cannot be told from a bias.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from identification.unknown.basis import Basis
from identification.unknown.scoring import Moments

Floats = NDArray[np.float64]

MOST = 2  # members
SHARE = 0.85  # of what the curve explains, that a form must explain
LENGTHS = 9
PLACES = (0.2, 0.35, 0.5, 0.65, 0.8)  # of the visited range, where steps and bends may be
SINGULAR = 1e-8


@dataclass(frozen=True, eq=False)
class Member:
    """One function of the library."""

    text: str  # with {x} for the driver
    of: Callable[[Floats], Floats]
    cost: float  # parameters beside its weight
    rise: float = 0.0  # logarithm of what the written function is over `of`


@dataclass(frozen=True, eq=False)
class Form:
    """A closed form."""

    text: str
    members: Sequence[Member]
    weights: Floats
    nats: float  # of log likelihood explained

    def __call__(self, x: Floats) -> Floats:
        """Its value (N,)."""
        return np.asarray(sum(w * m.of(x) for w, m in zip(self.weights, self.members, strict=True)), float)


def library(base: Basis, near: float | None) -> list[Member]:
    """What a curve over this driver may be; arguments are held at the ends of what was visited."""
    low, high = base.low, base.high
    span = high - low

    def member(text: str, of: Callable[[Floats], Floats], cost: float = 0.0) -> Member:
        return Member(text, lambda x: of(np.clip(x, low, high)), cost)

    found = [member("{x}", np.positive), member("{x}^2", np.square), member("{x}^3", partial(_power, 3.0))]
    if low < 0.0 < high:
        found += [member("{x}*|{x}|", _signed_square), member("|{x}|", np.abs)]
    if near is not None or low > 0.05 * span:
        held = partial(_at_least, max(low, near or 0.0))
        found += [member("1/{x}", partial(held, -1.0)), member("1/{x}^2", partial(held, -2.0))]
    for length in np.geomspace(0.08 * span, 1.5 * span, LENGTHS).tolist():
        found.append(Member(f"exp(-{{x}}/{length:.2g})", partial(_decay, low, high, length), 1.0, low / length))
    for place in (low + span * np.array(PLACES)).tolist():
        found.append(member(f"({{x}} > {place:.3g})", partial(_step, place), 1.0))
        found.append(member(f"max({{x}} - {place:.3g}, 0)", partial(_bend, place, 1.0), 1.0))
        found.append(member(f"max({place:.3g} - {{x}}, 0)", partial(_bend, place, -1.0), 1.0))
    return found


def _power(power: float, x: Floats) -> Floats:
    return np.asarray(x**power)


def _signed_square(x: Floats) -> Floats:
    return np.asarray(x * np.abs(x))


def _at_least(least: float, power: float, x: Floats) -> Floats:
    return np.asarray(np.maximum(x, least) ** power)


def _decay(low: float, high: float, length: float, x: Floats) -> Floats:
    """Counted from the least that was visited, so that it is of the size of one there."""
    return np.asarray(np.exp(-(np.clip(x, low, high) - low) / length))


def _step(place: float, x: Floats) -> Floats:
    return np.asarray((x > place) * 1.0)


def _bend(place: float, sign: float, x: Floats) -> Floats:
    return np.asarray(np.maximum(sign * (x - place), 0.0))


def fit(members: Sequence[Member], moments: Moments, name: str, rows: int, curve: float) -> Form | None:
    """The best form, None where none explains most of what the curve does.

    moments: of the members' weights; rows: that the channel has; curve [nats] of log likelihood that it explains.
    """
    g, b = moments.information, moments.score
    own = np.diag(g)
    best: tuple[float, tuple[int, ...], Floats, float] | None = None
    for size in range(1, MOST + 1):
        for chosen in combinations(np.flatnonzero(own > SINGULAR * own.max()).tolist(), size):
            inner = g[np.ix_(chosen, chosen)]
            scale = np.sqrt(np.diag(inner))
            if np.linalg.det(inner / np.outer(scale, scale)) < 1e-3:
                continue
            weights = np.asarray(np.linalg.solve(inner, b[list(chosen)]), np.float64)
            nats = 0.5 * float(weights @ b[list(chosen)])
            free = size + sum(members[i].cost for i in chosen)
            value = float(nats - 0.5 * free * np.log(max(rows, 2)))
            if best is None or value > best[0]:
                best = value, chosen, weights, nats
    if best is None or best[3] < SHARE * curve:
        return None
    _, chosen, weights, nats = best
    picked = [members[i] for i in chosen]
    return Form(_text(picked, weights, name), picked, weights, nats)


def _text(members: Sequence[Member], weights: Floats, name: str) -> str:
    parts = []
    for member, weight in zip(members, weights.tolist(), strict=True):
        parts.append(f"{weight * np.exp(member.rise):+.3g}*{member.text.format(x=name)}")
    return " ".join(parts).lstrip("+")
