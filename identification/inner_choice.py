"""Which structure of a joint, and how hard to fit it: chosen by cross-validation on the rows that may be seen.

A fold leaves out APART + HORIZON seconds: runs of HORIZON that begin within APART are predicted by a fit to shorter
runs that touch none of those seconds. The structure is that of least error, found group by group from the fullest
physical guess. How hard to fit (length of the fitted runs, what a good model may be off) is the most cautious choice
within one standard error of the best, paired by fold.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from identification.one_joint import OneJoint
from identification.rig_fit import INDEPENDENT, SAMPLED, Free

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

HORIZON = 5.0  # [s] of the runs that are predicted: longer ones would leave too little to fit
APART = 5.0  # [s] in which the runs of one fold begin
EVERY = 1.25  # [s]
FEWEST = 4  # runs that a fit needs
ROUNDS = 15
PASSES = 2  # over the groups
FURTHEST = 50.0  # spreads, beyond which a run is not more wrong

Structure = Mapping[str, str]  # by group, the option
Options = Mapping[str, Mapping[str, tuple[Free, ...]]]  # by group and option, what is free


@dataclass(frozen=True)
class Hardness:
    """How hard a joint is fitted."""

    horizon: float  # [s] of fitted runs
    spread: float  # [rad] that a good model's runs may be off


@dataclass(frozen=True, eq=False)
class Choice:
    """What came of it."""

    structure: Structure
    hardness: Hardness
    error: float  # [rad] root mean square of the inner runs
    looked_at: Mapping[str, float]  # by structure or hardness, in words, its inner error


class Inner:
    """The rows of a joint that may be seen, and the models that were tried on them."""

    def __init__(self, joint: OneJoint, base: Sequence[Free], options: Options) -> None:
        """Base: what is free in every structure."""
        self.joint, self.base, self.options = joint, tuple(base), options
        self._rows = len(joint.course.angles)
        self._known: dict[tuple[tuple[str, ...], Hardness], Floats] = {}

    def free(self, structure: Structure) -> tuple[Free, ...]:
        """All that is free in a structure."""
        return (*self.base, *(f for group, option in structure.items() for f in self.options[group][option]))

    def choose(self, start: Structure, first: Hardness, hardnesses: Sequence[Hardness]) -> Choice:
        """See the module; `hardnesses`: the most cautious first."""
        looked: dict[str, float] = {}

        def error(structure: Structure, how: Hardness) -> float:
            found = _rms(self.errors(structure, how))
            looked[_told(structure, how)] = found
            return found

        best = dict(start)
        for _ in range(PASSES):
            before = dict(best)
            for group, given in self.options.items():
                best = min(({**best, group: option} for option in given), key=lambda s: error(s, first))
            if best == before:
                break
        chosen = self.hardened(best, hardnesses)
        looked |= {_told(best, how): _rms(self.errors(best, how)) for how in hardnesses}
        return Choice(best, chosen, _rms(self.errors(best, chosen)), looked)

    def hardened(self, structure: Structure, hardnesses: Sequence[Hardness]) -> Hardness:
        """The first of `hardnesses`, the most cautious, that is as good as the best within one standard error."""
        least = min(hardnesses, key=lambda how: _rms(self.errors(structure, how)))
        return next(how for how in hardnesses if self._as_good(structure, how, least))

    def fit(self, structure: Structure, how: Hardness) -> dict[str, float]:
        """The most probable values of all that is free, on all the rows that may be seen."""
        free, length = self.free(structure), round(how.horizon / self.joint.course.dt)
        rows = np.arange(0, self._rows - length + 1, max(1, length // 2))
        return _values(free, self._fit(free, rows, length, how, np.zeros(len(free))))

    def _as_good(self, structure: Structure, how: Hardness, least: Hardness) -> bool:
        more = self.errors(structure, how) - self.errors(structure, least)
        return bool(more.mean() <= more.std(ddof=1) / math.sqrt(len(more)))

    def errors(self, structure: Structure, how: Hardness) -> Floats:
        """Mean square (folds,) [rad^2] of the runs of each fold."""
        key = tuple(structure.values()), how
        if key not in self._known:
            self._known[key] = self._errors(self.free(structure), how)
        return self._known[key]

    def _errors(self, free: Sequence[Free], how: Hardness) -> Floats:
        dt = self.joint.course.dt
        length, tested = round(how.horizon / dt), round(HORIZON / dt)
        apart, step = round(APART / dt), round(EVERY / dt)
        fitted = np.arange(0, self._rows - length + 1, max(1, length // 2))
        whole = self._fit(free, fitted, length, how, np.zeros(len(free)))
        found = []
        for first in range(0, self._rows - tested, apart):
            out = np.arange(first, min(first + apart, self._rows - tested), step)
            rest = fitted[(fitted + length <= first) | (fitted >= first + apart + tested)]
            if len(rest) < FEWEST:
                continue
            x = self._fit(free, rest, length, how, whole)
            off = self.joint.run(out, tested, _values(free, x)) - self.joint.measured(out, tested)
            found.append(float(np.mean(np.minimum(off**2, (2.0 * math.pi) ** 2))))
        return np.array(found)

    def _fit(self, free: Sequence[Free], rows: Rows, length: int, how: Hardness, start: Floats) -> Floats:
        stride = max(1, round(SAMPLED / self.joint.course.dt))
        seen = self.joint.measured(rows, length)[:, ::stride]
        weight = math.sqrt(stride * self.joint.course.dt / INDEPENDENT) / how.spread

        def residual(x: Floats) -> Floats:
            off = self.joint.run(rows, length, _values(free, x))[:, ::stride] - seen
            return np.concatenate([x, np.clip(off * weight, -FURTHEST, FURTHEST).ravel()])

        return np.asarray(least_squares(residual, start, diff_step=1e-3, x_scale=0.3, max_nfev=ROUNDS).x)


def _told(structure: Structure, how: Hardness) -> str:
    return f"{', '.join(structure.values())}; runs of {how.horizon:g} s, {how.spread:g} rad"


def _values(free: Sequence[Free], x: Floats) -> dict[str, float]:
    return {f.key: f.value(float(at)) for f, at in zip(free, x, strict=True)}


def _rms(squares: Floats) -> float:
    return float(np.sqrt(squares.mean()))
