"""The search for what is wrong: linear screening of every cause, refits of the best, sets grown and pruned.

Screening ranks; only refits count. A set grows by the cause that gains most evidence on top of it, members are
exchanged and dropped where that loses nothing, and it stops where nothing gains the threshold.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

from identification.bench import Bench
from identification.causes.contract import Cause
from identification.competition import Competition, Score
from identification.null import THRESHOLD
from identification.overruled import overruled
from identification.refit import Refit, linear_cost, refit

REFITTED = 4  # of the best of a screening
CLOSE = 1.0  # [nats] to what the screening promised, where no other start is tried
WORTH = 0.2  # of the threshold, in linear evidence: below it a cause is not refitted, but for rough ones
HOPELESS = 0.05  # of what another cause gained, in linear evidence, below which a cause is not refitted
INEXACT = 0.01  # of what a set explains, that a further cause must gain
LEAST = -2.0  # [nats] of linear evidence below which no larger set is looked at
MOST = 3  # causes in a set
FEW = 14  # causes, up to which every set of them is looked at

Names = tuple[str, ...]


@dataclass(eq=False)
class Search:
    """What was tried on one bench."""

    bench: Bench
    threshold: float = THRESHOLD
    refits: dict[Names, Refit] = field(default_factory=dict)
    screened: dict[Names, list[Score]] = field(default_factory=dict)

    @property
    def null(self) -> Refit:
        """Nothing wrong: everything within its tolerance."""
        return self.fit(())

    def _needed(self, names: Names) -> float:
        """What a further cause must gain on top of this set: what the first leaves is not as sound as flights are.

        The less so the more the set explains: no form is right to a hundredth.
        """
        if not names:
            return self.threshold
        return max(self.threshold, float(getattr(self.bench, "beside", 0.0)), INEXACT * self.gain(names))

    @property
    def causes(self) -> Mapping[str, Cause]:
        """All that can be tested here."""
        return {cause.name: cause for cause in self.bench.causes}

    def fit(self, names: Sequence[str], start: Mapping[str, float] | None = None) -> Refit:
        """This set at its best values; taken from before where it was fitted already."""
        key = tuple(sorted(names))
        if key not in self.refits:
            chosen = [self.causes[name] for name in key]
            begin = getattr(self.bench, "start", None)
            base = begin(key) if begin else ({} if key == () else dict(self.null.at))
            self.refits[key] = refit(self.bench, chosen, base | dict(start or {}))
        return self.refits[key]

    def gain(self, names: Sequence[str]) -> float:
        """Log evidence of a set over none."""
        return self.fit(names).log_evidence - self.null.log_evidence

    def screen(self, names: Sequence[str] = ()) -> list[Score]:
        """Every other cause on top of a set, linear about the set's best values, best first."""
        key = tuple(sorted(names))
        if key not in self.screened:
            self.screened[key] = self.competition(key).singles()
        return self.screened[key]

    def competition(self, names: Sequence[str] = ()) -> Competition:
        """All causes that are not in the set, about its best values."""
        at = self.fit(names)
        own = {p.key for name in names for p in self.causes[name].parameters}
        free = dict(self.bench.tolerances) | {key: self.bench.spreads[key] for key in own}
        others = [cause for cause in self.bench.causes if cause.name not in names]
        about = getattr(self.bench, "expanded", None)
        shift = {key: value - self.bench.nominal[key] for key, value in at.at.items()}
        linear, moved = about() if about else (at.stack, shift)
        return Competition(linear, free, others, self.bench.spreads, moved)

    def run(self, until: Callable[[Names], bool] | None = None) -> Names:
        """The set of causes that is asserted, none of which loses less than the threshold when left out.

        until: whether a set is not to be grown any further.
        """
        if len(self.causes) <= FEW and getattr(self.bench, "every_set", False):
            return self._prune(self._choose())
        best: Names = ()
        while len(best) < MOST:
            grown = self._grow(best)
            if grown is None:
                break
            best = self._prune(grown)
            if until is not None and until(best):
                break
        return best

    def _choose(self) -> Names:
        """The best of all sets, where there are few: the linear best of each size are refitted."""
        competition = self.competition()
        sure, least = hasattr(self.bench, "expanded"), LEAST  # one that is linear about the truth ranks for sure
        tried: list[Names] = [()]
        for size in range(1, MOST + 1):
            scores = [competition.score(*names) for names in combinations(sorted(self.causes), size)]
            scores.sort(key=lambda score: -score.log_evidence)
            if sure and scores[0].log_evidence < least:
                break  # nothing that a further cause would gain
            least = scores[0].log_evidence
            for score in scores[:REFITTED]:
                if sure and score.log_evidence < least - self.threshold:
                    break
                moved = {k: self.bench.bounded(k, self.bench.nominal[k] + step) for k, step in score.mean.items()}
                self.fit(score.causes, moved)
                tried.append(tuple(sorted(score.causes)))
        return max(tried, key=lambda names: self.gain(names) - self.threshold * len(names))

    def _grow(self, names: Names) -> Names | None:
        tried: list[Names] = []
        gained = 0.0
        for score in self.screen(names)[:REFITTED]:
            if score.log_evidence < HOPELESS * gained:
                continue
            if score.log_evidence > WORTH * self.threshold or self.causes[score.causes[0]].starts:
                larger = self._larger(names, score)
                if not overruled(self.bench, self.causes[score.causes[0]], self.fit(names), self.fit(larger)):
                    tried.append(larger)
                    gained = max(gained, self.gain(larger) - self.gain(names))
        if not tried:
            return None
        best = max(tried, key=self.gain)
        return best if self.gain(best) > self.gain(names) + self._needed(names) else None

    def _larger(self, names: Names, score: Score) -> Names:
        """A set with a further cause fitted from several places, until one gains what the screening promised."""
        larger = tuple(sorted((*names, *score.causes)))
        if larger in self.refits:
            return larger
        start, chosen = self.fit(names), [self.causes[name] for name in larger]
        found: Refit | None = None
        for place in self._places(larger, score, dict(start.at)):
            other = refit(self.bench, chosen, place)
            if found is None or other.log_evidence > found.log_evidence:
                found = other
            kept = found.log_evidence > start.log_evidence + score.log_evidence - CLOSE
            if kept or score.log_evidence < self.threshold:
                break
        assert found is not None
        self.refits[larger] = found
        return larger

    def _places(self, larger: Names, score: Score, at: dict[str, float]) -> list[dict[str, float]]:
        """Where the fit of a larger set may begin; at: where the smaller one ended."""
        bench, parameters = self.bench, self.causes[score.causes[0]].parameters
        starts = self.causes[score.causes[0]].starts
        if starts is not None:
            taken: Mapping[str, float] = getattr(bench, "in_force", {})
            known = tuple(taken[p.key] for p in parameters if p.key in taken)
            far = [at | {p.key: value for p, value in zip(parameters, start, strict=True)}
                   for start in starts(known or None)]  # fmt: skip
            return [min(far, key=lambda place: linear_cost(bench, place))]
        begin = getattr(bench, "start", None)
        if begin:  # where a long step of one number alone would lead astray
            return [at, dict(begin(larger))]
        values = {key: at.get(key, bench.nominal[key]) for key in score.mean}
        return [at | {key: bench.bounded(key, values[key] + step) for key, step in score.mean.items()}, at]

    def _without(self, names: Names, name: str) -> Names:
        """A set less one cause, fitted from where the set is too: what a cause gains is not what its absence lost."""
        smaller = tuple(n for n in names if n != name)
        own = {p.key for p in self.causes[name].parameters}
        begin = {key: value for key, value in self.fit(names).at.items() if key not in own}
        other = refit(self.bench, [self.causes[n] for n in smaller], begin)
        if other.log_evidence > self.fit(smaller).log_evidence:
            self.refits[smaller] = other
        return smaller

    def _prune(self, names: Names) -> Names:
        """Leave out what is not needed any more."""
        while names:
            smaller = max([self._without(names, name) for name in names], key=self.gain)
            if self.gain(names) > self.gain(smaller) + self._needed(smaller):
                break
            names = smaller
        return names
