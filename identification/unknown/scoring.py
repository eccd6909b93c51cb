"""How much every unknown effect explains on top of a hypothesis, in the same likelihood as that of the causes.

An effect is a curve of one driver in one way, with a prior on how large and how wiggly it is. Everything that the
hypothesis leaves free is eliminated, flight by flight what belongs to the flight, then what all share:

    log p(r | curve) = 1/2 b' (I + D G D)^-1 b' - 1/2 log |I + D G D|,   b' = D b,   D = size / j

with G and b of the curve's functions j after elimination, averaged over a few sizes and numbers of functions.
"""

import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from identification.search import Names, Search
from identification.unknown.bank import Bank, Columns
from identification.unknown.basis import FUNCTIONS, Basis, basis

Floats = NDArray[np.float64]

SIZES = (2.0, 5.0, 12.0, 30.0, 80.0, 200.0)  # in standard deviations of the best determined function
NUMBERS = (1, 2, FUNCTIONS)  # of functions
SHRINK = 1.0 / np.arange(1, FUNCTIONS + 1)

Place = tuple[str, str]  # way, driver


@dataclass(frozen=True, eq=False)
class Moments:
    """What the flights say of some columns' weights (C,), all else eliminated."""

    information: Floats  # (C, C)
    score: Floats  # (C,)


@dataclass(frozen=True, eq=False)
class Weighed:
    """A curve at its best."""

    nats: float  # log evidence over no such effect
    mean: Floats  # (S,) weights of the functions
    covariance: Floats  # (S, S)
    std: Floats  # (S,) the prior that suits it best
    strength: float  # d'


@dataclass(frozen=True, eq=False)
class Effect:
    """An unknown effect that is taken as there."""

    place: Place
    std: Floats  # (S,) prior of its functions' weights


class Elimination:
    """A set of causes at its best values, and everything it leaves free taken out of what is held against it."""

    def __init__(
        self, search: Search, names: Names, bank: Bank, bases: Mapping[str, Basis], effects: Sequence[Effect] = (),
        parts: Sequence[NDArray[np.bool_]] | None = None,
    ) -> None:  # fmt: skip
        """Of all flights, or of these rows of each; effects: found already, free with the rest."""
        bench, fit = search.bench, search.fit(names)
        self._parts = parts
        own = {p.key for name in names for p in search.causes[name].parameters}
        free = dict(bench.tolerances) | {key: bench.spreads[key] for key in own}
        self._designs: list[Floats] = []  # by flight: locals, shared, residual
        self._grams: list[Floats] = []  # of the locals
        self._solved: list[Floats] = []  # what locals take of shared and residual
        left: list[Floats] = []
        for i in range(len(bench.names)):
            rows = bench.rows(i, fit.at)
            keys = [key for key in rows.signatures if free.get(key, 0.0) > 0.0]
            shared = np.column_stack([rows.signatures[key] * free[key] for key in keys])
            shift = np.array([(fit.at[key] - bench.nominal[key]) / free[key] if key in fit.at else 0.0 for key in keys])
            residual = rows.residual + rows.local @ rows.at + shared @ shift
            more = [_whole(bank, bases, effect, i, len(residual)) for effect in effects]
            design = np.column_stack([rows.local * rows.local_std, shared, *more, residual])
            if parts is not None:
                design[~parts[i]] = 0.0
            local = len(rows.local_std)
            square = design.T @ design
            gram = np.eye(local) + square[:local, :local]
            solved = np.linalg.solve(gram, square[:local, local:])
            left.append(square[local:, local:] - square[local:, :local] @ solved)
            self._designs.append(design)
            self._grams.append(gram)
            self._solved.append(solved)
        total: Floats = np.sum(left, axis=0)
        self._factor = cho_factor(np.eye(len(total) - 1) + total[:-1, :-1])
        self._pulled = cho_solve(self._factor, total[:-1, -1])

    def moments(self, parts: Sequence[Columns]) -> Moments:
        """Of the same columns on every flight."""
        inner: list[Floats] = []
        outer: list[Floats] = []
        if self._parts is not None:
            parts = [
                Columns(part.rows, part.values * inside[part.rows, None])
                for part, inside in zip(parts, self._parts, strict=True)
            ]
        for part, design, gram, solved in zip(parts, self._designs, self._grams, self._solved, strict=True):
            raw, local = part.values.T @ design[part.rows], len(gram)
            inner.append(part.values.T @ part.values - raw[:, :local] @ np.linalg.solve(gram, raw[:, :local].T))
            outer.append(raw[:, local:] - raw[:, :local] @ solved)
        cross: Floats = np.sum(outer, axis=0)
        found: Floats = np.sum(inner, axis=0) - cross[:, :-1] @ cho_solve(self._factor, cross[:, :-1].T)
        return Moments(0.5 * (found + found.T), cross[:, -1] - cross[:, :-1] @ self._pulled)


def _whole(bank: Bank, bases: Mapping[str, Basis], effect: Effect, flight: int, rows: int) -> Floats:
    """(rows, S) an effect's functions, in standard deviations of their prior."""
    way, driver = effect.place
    part = bank.columns(flight, way, bases[driver](bank.drivers(flight)[driver].values) * effect.std)
    whole = np.zeros((rows, part.values.shape[1]))
    whole[part.rows] = part.values
    return whole


def weigh(moments: Moments) -> Weighed:
    """The evidence of a curve, averaged over its prior's sizes and numbers of functions."""
    return weigh_all([moments])[0]


def weigh_all(moments: Sequence[Moments]) -> list[Weighed]:
    """`weigh` of each of these, (S,) functions in all of them."""
    g = np.stack([m.information for m in moments])  # (K, S, S)
    b = np.stack([m.score for m in moments])
    functions = b.shape[1]
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(g, axis1=1, axis2=2).max(axis=1), 1e-300))
    tried = [(number, size) for number in NUMBERS for size in SIZES]
    # (T, S): a function that is left out is held at nothing
    shrink = np.array([size * SHRINK[:functions] * (np.arange(functions) < number) for number, size in tried])
    d = scale[:, None, None] * shrink  # (K, T, S)
    lower = np.linalg.cholesky(np.eye(functions) + d[..., :, None] * g[:, None] * d[..., None, :])
    pulled = np.linalg.solve(lower, (d * b[:, None])[..., None])[..., 0]
    logs = np.log(np.diagonal(lower, axis1=2, axis2=3)).sum(axis=2)
    evidence = 0.5 * np.sum(pulled**2, axis=2) - logs  # (K, T)
    nats = np.logaddexp.reduce(evidence, axis=1) - math.log(len(tried))
    found = []
    for m, value, std in zip(moments, nats.tolist(), d[np.arange(len(d)), np.argmax(evidence, axis=1)], strict=True):
        mean, covariance = posterior(m, std)
        strength = math.sqrt(max(float(mean @ m.information @ mean), 0.0))
        found.append(Weighed(value, mean, covariance, std, strength))
    return found


def posterior(moments: Moments, std: Floats) -> tuple[Floats, Floats]:
    """Mean (C,) and covariance (C, C) of weights whose prior is normal about nothing; std (C,), 0: not there."""
    d = np.asarray(std, float)
    inner = np.linalg.inv(np.eye(len(d)) + d[:, None] * moments.information * d)
    covariance = d[:, None] * inner * d
    return np.asarray(covariance @ moments.score), covariance


def held_out(units: Sequence[Moments], std: Floats) -> float:
    """[nats] of log likelihood that a curve gains on each unit when it is fitted to all the others.

    std (S,): prior of its functions' weights.
    """
    used = std > 0.0
    d = std[used]
    total = 0.0
    for held in range(len(units)):
        others = [unit for i, unit in enumerate(units) if i != held]
        g = np.sum([unit.information[np.ix_(used, used)] for unit in others], axis=0)
        b = np.sum([unit.score[used] for unit in others], axis=0)
        mean = d * np.linalg.solve(np.eye(len(d)) + d[:, None] * g * d, d * b)
        own = units[held]
        total += float(mean @ own.score[used] - 0.5 * mean @ own.information[np.ix_(used, used)] @ mean)
    return total


def scan(
    bank: Bank, bases: Mapping[str, Basis], eliminations: Sequence[Elimination], flights: int
) -> list[dict[Place, Weighed]]:
    """Every curve on top of every hypothesis; signatures are made once."""
    shapes = [
        np.column_stack([base(along[driver].values) for driver, base in bases.items()])
        for along in (bank.drivers(i) for i in range(flights))
    ]
    found: list[dict[Place, Weighed]] = [{} for _ in eliminations]

    def along(way: str) -> list[Moments]:
        parts = [bank.columns(i, way, shape) for i, shape in enumerate(shapes)]
        return [elimination.moments(parts) for elimination in eliminations]

    def cut(whole: Moments, n: int) -> Moments:
        own = slice(n * FUNCTIONS, (n + 1) * FUNCTIONS)
        return Moments(whole.information[own, own], whole.score[own])

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for way, moments in zip(bank.ways, pool.map(along, bank.ways), strict=True):
            for found_here, whole in zip(found, moments, strict=True):
                weighed = weigh_all([cut(whole, n) for n in range(len(bases))])
                found_here |= {(way, driver): item for driver, item in zip(bases, weighed, strict=True)}
    return found


def over(bank: Bank, flights: int) -> dict[str, Basis]:
    """Functions of every driver that moves, over what all flights visited."""
    along = [bank.drivers(i) for i in range(flights)]
    found = {}
    for name in along[0]:
        if all(name in item for item in along):
            made = basis(np.concatenate([item[name].values for item in along]), along[0][name].near)
            if made is not None:
                found[name] = made
    return found
