"""Linear prediction of rows that were not fitted.

About one expansion point every hypothesis is r = J theta + L lambda + e, e ~ N(0, 1): theta shared by all flights,
lambda a flight's own. Causes are trained on the fitted units and stay so on the held-out one; what may be off without
any (tolerances, the wind) follows that one within its prior. The expansion point itself is that of the fit to
everything, which a fold moves from by a fraction of a standard deviation; the model is not run again.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from identification.stack import Rows

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_STD = 1e-12  # of a number that is known
ALONE = 0.7  # of what a parameter does to the rows, in one fifth of the flight
TURN = 2.0  # [s] held out in one piece: several times what the filters remember of an innovation


@dataclass(frozen=True, eq=False)
class Unit:
    """What is held out together: some rows of one flight."""

    flight: int
    rows: Mask  # (R,)


@dataclass(frozen=True, eq=False)
class Held:
    """One unit as predicted from the others."""

    log_likelihood: float  # up to what all hypotheses share
    residual: Floats  # (R of the unit,) what is left once all that may be off anyway has followed the unit
    nuisances: Mapping[str, float]  # by key, where those have gone, in standard deviations of their priors


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Flights about one expansion point, and how free each shared number is."""

    flights: Sequence[Rows]
    std: Mapping[str, float]  # by key, of its prior; > 0
    shift: Mapping[str, float]  # by key, expansion point less nominal value
    own: frozenset[str] = frozenset()  # keys of causes: they alone are trained, and stay so on a held-out unit
    _normal: dict[int, tuple[Floats, Floats]] = field(default_factory=dict)  # by unit

    def __post_init__(self) -> None:
        for key, std in self.std.items():
            if not std > LEAST_STD:
                raise ValueError(f"{key}: prior's standard deviation must be more than 0 (got {std})")

    def design(self, unit: Unit) -> tuple[Floats, Floats]:
        """(R, K + L) in units of the priors, and the residual (R,) that the nominal values would leave."""
        rows = self.flights[unit.flight]
        shared = np.column_stack(
            [rows.signatures[key][unit.rows] for key in self.std] or [np.zeros((unit.rows.sum(), 0))]
        )
        moved = np.array([self.shift.get(key, 0.0) for key in self.std])
        residual = rows.residual[unit.rows] + shared @ moved + rows.local[unit.rows] @ rows.at
        scaled = shared * np.array(list(self.std.values()))
        return np.hstack([scaled, rows.local[unit.rows] * rows.local_std]), residual

    def normal(self, unit: Unit) -> tuple[Floats, Floats]:
        """(K + L, K + L) and (K + L,): the design's square, and its product with the residual; kept."""
        if id(unit) not in self._normal:
            x, r = self.design(unit)
            self._normal[id(unit)] = x.T @ x, x.T @ r
        return self._normal[id(unit)]


def predict(
    hypothesis: Hypothesis, units: Sequence[Unit], held: int, test: Hypothesis | None = None, whole_fit: bool = False
) -> Held:
    """The unit `held` from all others of `units`; with `test`, a unit of that hypothesis' flights from all of `units`.

    Causes are trained on the others. What may be off without any starts from its tolerance, as in a vehicle file that
    is extended by the causes alone; with `whole_fit` it is trained as well, as in a fit of all parameters.
    Raises ValueError where test and training do not share their numbers.
    """
    k = len(hypothesis.std)
    other = test if test is not None else hypothesis
    if list(other.std) != list(hypothesis.std):
        raise ValueError("test and training must have the same free numbers")
    unit = units[held] if test is None else Unit(held, np.ones(len(test.flights[held].residual), bool))
    mean, precision = _trained(hypothesis, units, None if test is not None else held, other, unit)
    fixed = [i for i, key in enumerate(hypothesis.std) if key in hypothesis.own]
    follows = [i for i in range(len(mean)) if i not in fixed]
    if not whole_fit:
        of_causes = np.linalg.inv(precision)[np.ix_(fixed, fixed)]
        precision = np.eye(len(mean))
        precision[np.ix_(fixed, fixed)] = np.linalg.inv(of_causes)
        mean[follows] = 0.0
    x, r = other.design(unit)
    error = r - x @ mean
    after = precision + x.T @ x
    back = x.T @ error
    likelihood = -0.5 * (_log_det(after) - _log_det(precision) + error @ error - back @ np.linalg.solve(after, back))
    free = x[:, follows]
    moved = np.linalg.solve(precision[np.ix_(follows, follows)] + free.T @ free, free.T @ error)
    where = mean[follows] + moved
    keys = list(hypothesis.std)
    gone = {keys[i]: float(value) for i, value in zip(follows, where, strict=True) if i < k}
    return Held(float(likelihood), error - free @ moved, gone)


def _trained(
    hypothesis: Hypothesis, units: Sequence[Unit], held: int | None, other: Hypothesis, unit: Unit
) -> tuple[Floats, Floats]:
    """Mean and precision of what is shared, and of the own unknowns of the flight that `unit` lies in."""
    k, own = len(hypothesis.std), len(other.flights[unit.flight].local_std)
    precision, pull = np.eye(k + own), np.zeros(k + own)
    by_flight: dict[int, list[tuple[Floats, Floats]]] = {}
    for i, item in enumerate(units):
        if i != held:
            by_flight.setdefault(item.flight, []).append(hypothesis.normal(item))
    for flight, parts in by_flight.items():
        a, b = (np.sum([part[i] for part in parts], axis=0) for i in range(2))
        if held is not None and flight == unit.flight:
            precision += a
            pull += b
            continue
        inner = np.eye(a.shape[0] - k) + a[k:, k:]  # the other flight's own unknowns leave
        solved = np.linalg.solve(inner, np.column_stack([a[k:, :k], b[k:]]))
        precision[:k, :k] += a[:k, :k] - a[:k, k:] @ solved[:, :k]
        pull[:k] += b[:k] - a[:k, k:] @ solved[:, k]
    return np.asarray(np.linalg.solve(precision, pull), float), precision


def fitted(hypothesis: Hypothesis, unit: Unit) -> Floats:
    """(R,) what is left of a unit when everything free is fitted to itself, as large as noise it has not followed.

    Of innovations with covariance 1 + X X^T the fit leaves (1 - H) of them, whose covariance is 1 - H: each is divided
    by its own share.
    """
    x, r = hypothesis.design(unit)
    back = np.linalg.solve(np.eye(x.shape[1]) + x.T @ x, x.T)
    left = r - x @ (back @ r)
    return np.asarray(left / np.sqrt(1.0 - np.einsum("rk,kr->r", x, back)))


def fifths(rows: Rows, count: int = 5) -> list[Unit]:
    """Contiguous stretches of equal length of a single flight."""
    edges = np.linspace(rows.t.min(), rows.t.max(), count + 1)
    which = np.clip(np.searchsorted(edges, rows.t, side="right") - 1, 0, count - 1)
    return [Unit(0, which == i) for i in range(count)]


def turns(rows: Rows, count: int = 5) -> list[Unit]:
    """Every fifth stretch of TURN of a single flight: each has seen all that the flight passed through."""
    turn = np.floor((rows.t - rows.t.min()) / TURN).astype(int) % count
    return [Unit(0, turn == i) for i in range(count)]


def confined(rows: Rows, keys: Collection[str], units: Sequence[Unit]) -> bool:
    """Whether one of these parameters shows in one unit alone, so that nothing could be learnt from the others."""
    for key in keys:
        shows = np.array([float(np.sum(rows.signatures[key][unit.rows] ** 2)) for unit in units])
        if shows.max() > ALONE * shows.sum():
            return True
    return False


def whole(flights: Sequence[Rows]) -> list[Unit]:
    """Each flight as a unit."""
    return [Unit(i, np.ones(len(rows.residual), bool)) for i, rows in enumerate(flights)]


def _log_det(matrix: Floats) -> float:
    return float(np.linalg.slogdet(matrix)[1])
