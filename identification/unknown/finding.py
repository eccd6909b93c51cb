"""The search for what nobody foresaw: on top of the best set of causes, or in place of those that it makes needless."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.search import Names, Search
from identification.unknown import formula, scoring
from identification.unknown.bank import Bank, Way
from identification.unknown.null import ALIKE, MARGIN
from identification.unknown.opening import limits, open_bank
from identification.unknown.scoring import Effect, Elimination, Moments, Place, Weighed, over, scan, weigh
from identification.verdict import Alternative, Curve, Unexplained

Floats = NDArray[np.float64]

MOST = 3  # effects
POINTS = 25  # of a curve
HELD = 5.0  # [nats] that a curve must gain where it was not fitted
NEARLY = 0.65  # of causes' and effect's log evidence together: a form not quite the catalogue's is still its cause
THIRDS, BLOCK = 3, 4.0  # [s]


@dataclass(frozen=True, eq=False)
class Found:
    """One effect that no cause of the catalogue explains."""

    way: Way
    driver: str
    driver_unit: str
    nats: float  # log evidence over none
    strength: float  # d'
    alternatives: Sequence[Alternative]
    x: Floats  # (P,) within what was visited
    values: Floats  # (P,) [the way's unit]; the constant in it is as uncertain as the channel's bias
    covariance: Floats  # (P, P)
    form: formula.Form | None
    visited: tuple[float, float]
    share: float  # of the channel's variance

    @property
    def depends_on(self) -> list[str]:
        """The driver, and those of the same channel that the data do not tell from it."""
        return [self.driver, *(a.driver for a in self.alternatives if a.channel == self.way.name)]

    def told(self) -> Unexplained:
        """As the verdict has it."""
        return Unexplained(
            channel=self.way.name, share_of_variance=self.share, depends_on=self.depends_on,
            form=None if self.form is None else self.form.text, nats=self.nats,
            alternatives=self.alternatives,
            curve=Curve(self.x.tolist(), self.driver_unit, self.values.tolist(), self.std.tolist(), self.way.unit),
        )  # fmt: skip

    @property
    def std(self) -> Floats:
        """(P,) of the curve."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


@dataclass(frozen=True, eq=False)
class Outcome:
    """What is there beside causes, and which of the causes are still needed."""

    causes: Names
    found: Sequence[Found]
    scanned: Mapping[Place, Weighed]  # on top of the set that was handed in

    @property
    def explained(self) -> float:
        """[nats] of log likelihood that the effects take, one on top of the other."""
        return 0.5 * sum(effect.strength**2 for effect in self.found)


NOTHING = Outcome((), (), {})


def find(search: Search, best: Names) -> Outcome:
    """Seek effects that explain more than chance does, and drop causes that only stood in for them."""
    bank = open_bank(search.bench)
    if bank is None:
        return Outcome(best, (), {})
    return _Finder(search, bank).run(best)


class _Finder:
    def __init__(self, search: Search, bank: Bank) -> None:
        self._search, self._bank, self._bench = search, bank, search.bench
        self._flights = len(search.bench.names)
        self._bases = over(bank, self._flights)
        self._limits = limits(search.bench)

    def run(self, best: Names) -> Outcome:
        names = best
        effects: list[Effect] = []
        scans: list[tuple[Place, Mapping[Place, Weighed]]] = []
        first: Mapping[Place, Weighed] = {}
        while len(effects) < MOST and self._bases:
            scores = self._scan(names, effects)
            first = first or scores
            place = max(scores, key=lambda p: scores[p].nats - self._limit(p))
            if scores[place].nats < self._limit(place):
                break
            if self._held_out(names, effects, place, scores[place]) < HELD:
                break
            smaller = self._drop(names, effects, place, scores[place])
            if smaller != names:  # what the effect is may look otherwise without them
                names = smaller
                scores = self._scan(names, effects)
                place = max(scores, key=lambda p: scores[p].nats - self._limit(p))
            effects.append(Effect(place, scores[place].std))
            scans.append((place, scores))
        found = [self._describe(names, effects, i, scores) for i, (_, scores) in enumerate(scans)]
        return Outcome(names, found, first)

    def _held_out(self, names: Names, effects: Sequence[Effect], place: Place, score: Weighed) -> float:
        """[nats] that the curve gains where it was not fitted: every third block of all flights by the other two.

        Not each flight by the others: one that is flown high says nothing of what is near the ground.
        """
        bench, fit = self._bench, self._search.fit(names)
        t = [bench.rows(i, fit.at).t for i in range(self._flights)]
        thirds = [np.floor((item - item.min()) / BLOCK).astype(int) % THIRDS for item in t]
        units = [[third == part for third in thirds] for part in range(THIRDS)]
        columns = [self._bank.columns(i, place[0], self._shapes(place, i)) for i in range(self._flights)]
        moments = [
            Elimination(self._search, names, self._bank, self._bases, effects, unit).moments(columns) for unit in units
        ]
        return scoring.held_out(moments, score.std)

    def _limit(self, place: Place) -> float:
        return self._limits.get(self._bank.ways[place[0]].group, MARGIN)

    def _scan(self, names: Names, effects: Sequence[Effect]) -> dict[Place, Weighed]:
        return scan(self._bank, self._bases, [self._taken(names, effects)], self._flights)[0]

    def _taken(self, names: Names, effects: Sequence[Effect]) -> Elimination:
        return Elimination(self._search, names, self._bank, self._bases, effects)

    def _shapes(self, place: Place, flight: int) -> Floats:
        return self._bases[place[1]](self._bank.drivers(flight)[place[1]].values)

    def _nats(self, names: Names, effects: Sequence[Effect]) -> float:
        """Log evidence of causes and effects together over nothing wrong."""
        total = self._search.gain(names)
        for i, effect in enumerate(effects):
            way, _ = effect.place
            parts = [self._bank.columns(f, way, self._shapes(effect.place, f)) for f in range(self._flights)]
            total += weigh(self._taken(names, effects[:i]).moments(parts)).nats
        return total

    def _drop(self, names: Names, effects: Sequence[Effect], place: Place, score: Weighed) -> Names:
        """Leave out causes that gain nothing any more once the effect is there.

        Not where they take nearly all by themselves: then the effect is but what their form leaves.
        """
        both = [*effects, Effect(place, score.std)]
        here = self._nats(names, both)
        if self._search.gain(names) > NEARLY * here:
            return names
        while names:
            tried = {n: tuple(m for m in names if m != n) for n in names}
            values = {n: self._nats(rest, both) for n, rest in tried.items()}
            worst = max(values, key=lambda n: values[n])
            if values[worst] < here - self._search.threshold:
                break
            names, here = tried[worst], values[worst]
        return names

    def _describe(self, names: Names, effects: Sequence[Effect], which: int, scores: Mapping[Place, Weighed]) -> Found:
        """The effect number `which`, all others there as well."""
        place = effects[which].place
        way, driver = place
        taken = self._taken(names, [e for i, e in enumerate(effects) if i != which])
        flights = range(self._flights)
        along = [self._bank.drivers(i)[driver] for i in flights]
        base = self._bases[driver]
        weighed = weigh(taken.moments([self._bank.columns(i, way, base(along[i].values)) for i in flights]))
        members = formula.library(base, along[0].near)
        values = np.concatenate([item.values for item in along])
        means = np.array([float(np.mean(m.of(values))) for m in members])
        shapes = [np.column_stack([m.of(a.values) for m in members]) - means for a in along]
        parts = [self._bank.columns(i, way, shapes[i]) for i in flights]
        moments: Moments = taken.moments(parts)
        rows = sum(int(np.count_nonzero(np.any(part.values != 0.0, axis=1))) for part in parts)
        explained = 0.5 * weighed.strength**2
        form = formula.fit(members, moments, driver, rows, explained)
        x = base.mesh[np.linspace(0, len(base.mesh) - 1, POINTS).astype(int)]
        # the constant is what biases within their priors leave of it
        held = np.column_stack([base(values), np.ones(len(values))])
        each = np.split(held, np.cumsum([len(a.values) for a in along])[:-1])
        whole = taken.moments([self._bank.columns(i, way, shape) for i, shape in enumerate(each)])
        prior = np.append(weighed.std, float(np.sqrt(np.sum(weighed.mean**2))))
        mean, covariance = scoring.posterior(whole, prior)
        at = np.column_stack([base(x), np.ones(len(x))])
        near = sorted(
            (p for p in scores if p != place and scores[p].nats > scores[place].nats - ALIKE),
            key=lambda p: -scores[p].nats,
        )
        return Found(
            way=self._bank.ways[way], driver=driver, driver_unit=along[0].unit, nats=scores[place].nats,
            strength=weighed.strength, alternatives=[Alternative(*p, scores[p].nats) for p in near], x=x,
            values=at @ mean, covariance=at @ covariance @ at.T, form=form, visited=(base.low, base.high),
            share=self._share(names, way, explained),
        )  # fmt: skip

    def _share(self, names: Names, way: str, explained: float) -> float:
        """Of the channel's variance, what the effect takes out."""
        bench, fit = self._bench, self._search.fit(names)
        number = next(n for n, c in bench.channels.items() if c.name == self._bank.ways[way].shows)
        rows = [bench.rows(i, fit.at) for i in range(self._flights)]
        square = sum(float(np.sum(r.residual[r.channel == number] ** 2)) for r in rows)
        return min(1.0, 2.0 * explained / max(square, 1e-300))
