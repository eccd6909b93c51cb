"""What the extension is worth on data that it was not fitted to.

Three models are held against the same rows: nothing wrong (everything toleranced is free within its tolerance), the
causes asserted, and everything free at once, which is what a fit of all parameters without a question about causes
comes to. Flights handed in for it are judged if there are any; else each flight by the others; else each
contiguous fifth of the only one by the rest of it, or shorter stretches where the rest would show nothing of a cause.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.bench import Bench
from identification.diagnosis import Diagnosis
from identification.folds import TURN, Hypothesis, Unit, confined, fifths, fitted, predict, turns, whole
from identification.refit import Refit
from identification.search import Names
from identification.stack import Rows
from identification.verdict import CauseGain, ChannelError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BLOCK = 2.0  # [s] rows resampled together: several times what the filters remember of an innovation
DRAWS = 400
LEVEL = (2.5, 97.5)  # [%]
PINNED = 1e-5  # of a prior's standard deviation: of a number that stays at its nominal value
HIDDEN = 0.02  # of the mean square: an excess over the floor smaller than this is none


@dataclass(frozen=True)
class ChannelGain:
    """One channel on held-out rows: root mean squares of what each model leaves, in `unit`."""

    channel: str
    unit: str
    before: float
    after: float
    everything: float  # with every parameter fitted
    floor: float  # with every parameter fitted to these very rows
    ratio_ci95: tuple[float, float]  # of after over before
    log_likelihood: float  # [nats] gained
    log_likelihood_ci95: tuple[float, float]
    rows: int

    @property
    def share_of_explainable(self) -> float:
        """Of the excess of the mean square over the floor, what the causes take out."""
        excess = self.before**2 - self.floor**2
        if excess <= HIDDEN * self.before**2:
            return 0.0
        return min(1.0, (self.before**2 - self.after**2) / excess)


@dataclass(frozen=True, eq=False)
class Residuals:
    """Held-out residuals of one flight, in standard deviations of the innovations."""

    flight: str
    channel: Ints  # (R,)
    t: Floats  # (R,) [s]
    before: Floats  # (R,)
    after: Floats  # (R,)
    everything: Floats  # (R,)
    floor: Floats  # (R,)


@dataclass(frozen=True, eq=False)
class Gain:
    """Held-out figures."""

    how: str  # in words
    judged: Bench  # whose flights were predicted
    channels: Sequence[ChannelGain]
    log_likelihood: float  # [nats] the causes over nothing
    log_likelihood_ci95: tuple[float, float]
    over_everything: float  # [nats] causes over all parameters, whatever may be off anyway trained by both
    residuals: Sequence[Residuals]

    @property
    def holds(self) -> bool:
        """Whether the held-out likelihood rises for sure."""
        return self.log_likelihood_ci95[0] > 0.0

    def best(self) -> ChannelGain | None:
        """The channel in which most is gained."""
        return max(self.channels, key=lambda c: c.log_likelihood, default=None)

    def errors(self) -> list[ChannelError]:
        """As the verdict has it."""
        return [ChannelError(c.channel, c.unit, c.before, c.after, c.floor, True) for c in self.channels]


def measure(diagnosis: Diagnosis, heldout: Bench | None = None, seed: int = 0) -> Gain:
    """Judge what was asserted on rows that it was not fitted to; `heldout`: a bench of other flights."""
    return compare(diagnosis, (), diagnosis.causes, heldout, seed)


def of_each(diagnosis: Diagnosis, together: Gain, heldout: Bench | None = None) -> dict[str, CauseGain]:
    """By asserted cause, what it adds to all the others where it adds most; `together`: what they all gain."""
    found = {}
    for name in diagnosis.causes:
        rest = tuple(n for n in diagnosis.causes if n != name)
        best = (compare(diagnosis, rest, diagnosis.causes, heldout, 0) if rest else together).best()
        if best is not None and best.before > 0.0:
            found[name] = CauseGain(best.channel, 1.0 - best.after / best.before, best.share_of_explainable)
    return found


def compare(diagnosis: Diagnosis, before: Names, after: Names, heldout: Bench | None, seed: int) -> Gain:
    """One set of causes, `before`, against a larger one.

    Each is as good as it can be: what may be off anyway follows the held-out rows under either. In the residual before,
    what the larger set has more stands at its nominal value; in the likelihood it is free within its tolerance.
    """
    bench, search = diagnosis.bench, diagnosis.search
    old, new = search.fit(before), search.fit(after)
    judged = heldout if heldout is not None else bench
    first, second = (_hypothesis(bench, fit, bench, names) for fit, names in ((old, before), (new, after)))
    every = _everything(bench, second)
    tests: list[Hypothesis | None] = [None, None, None]
    if heldout is not None:
        one, two = (_hypothesis(heldout, fit, bench, names) for fit, names in ((old, before), (new, after)))
        tests = [one, two, _everything(bench, two)]
    target = tests[1] if tests[1] is not None else second
    how, units = _units(second.flights, heldout, bench, _own(bench, after))
    held_units = units if heldout is None else whole(target.flights)
    count = range(len(held_units))
    held = [
        [predict(h, units, i, t, h is every) for i in count] for h, t in zip((first, second, every), tests, strict=True)
    ]
    at_rest = _own(bench, after) - _own(bench, before)
    resting = _pinned(first, at_rest)
    tested = None if tests[0] is None else _pinned(tests[0], at_rest)
    left = [predict(resting, units, i, tested) for i in count] if before != after else held[1]
    best = tests[2] if tests[2] is not None else every
    of_flight = [fitted(best, unit) for unit in whole(best.flights)]
    floors = [of_flight[unit.flight][unit.rows] for unit in held_units]
    models = [*([item.residual for item in one] for one in (left, held[1], held[2])), floors]
    residuals = _residuals(judged, target.flights, held_units, models)
    channels, draws = _channels(judged, residuals, np.random.default_rng(seed))
    trained = sum(predict(second, units, i, tests[1], True).log_likelihood for i in count)  # as `every` is
    total = [sum(item.log_likelihood for item in one) for one in held]
    gained = total[1] - total[0] if before != after else 0.0
    return Gain(
        how=how, judged=judged, channels=channels, log_likelihood=gained,
        log_likelihood_ci95=_about(gained, draws),
        over_everything=trained - total[2], residuals=residuals,
    )  # fmt: skip


def _pinned(hypothesis: Hypothesis, keys: Collection[str]) -> Hypothesis:
    """The same with some numbers at their nominal values."""
    std = {key: PINNED * value if key in keys else value for key, value in hypothesis.std.items()}
    return Hypothesis(hypothesis.flights, std, hypothesis.shift, hypothesis.own)


def _everything(bench: Bench, about: Hypothesis) -> Hypothesis:
    """Every parameter of every cause free."""
    names = [cause.name for cause in bench.causes]
    return Hypothesis(about.flights, _free(bench, names), about.shift, _own(bench, names))


def _free(bench: Bench, names: Sequence[str]) -> dict[str, float]:
    """Prior standard deviation of every number that is free when these causes may be at work."""
    free = dict(bench.tolerances) | {key: bench.spreads[key] for key in _own(bench, names)}
    return {key: free[key] for key in sorted(free) if free[key] > 0.0}


def _own(bench: Bench, names: Sequence[str]) -> frozenset[str]:
    """Keys of the parameters of these causes."""
    return frozenset(p.key for cause in bench.causes if cause.name in names for p in cause.parameters)


def _hypothesis(flown: Bench, fit: Refit, fitted_on: Bench, names: Sequence[str]) -> Hypothesis:
    """The flights of a bench about the best values that were found on another, or on it."""
    flights = [flown.rows(i, fit.at) for i in range(len(flown.names))]
    shift = {key: value - fitted_on.nominal[key] for key, value in fit.at.items()}
    return Hypothesis(flights, _free(fitted_on, names), shift, _own(fitted_on, names))


def _units(
    flights: Sequence[Rows], heldout: Bench | None, bench: Bench, own: Collection[str]
) -> tuple[str, list[Unit]]:
    if heldout is not None:
        return f"{len(heldout.names)} other flight(s), fitted to {len(bench.names)}", whole(flights)
    if len(flights) > 1:
        return f"each of {len(flights)} flights by the others", whole(flights)
    parts = fifths(flights[0])
    if not confined(flights[0], own, parts):
        return "contiguous fifths of the flight, each by the others", parts
    turned = f"every fifth stretch of {TURN:g} s by the others: what is named shows in one fifth of the flight alone"
    return turned, turns(flights[0])


def _residuals(
    bench: Bench, flights: Sequence[Rows], units: Sequence[Unit], models: Sequence[Sequence[Floats]]
) -> list[Residuals]:
    """What each of four models leaves of each unit, put back in order flight by flight."""
    found = []
    for i, name in enumerate(bench.names):
        rows = flights[i]
        columns = np.zeros((4, len(rows.residual)))
        for u, unit in enumerate(units):
            if unit.flight == i:
                columns[:, unit.rows] = [model[u] for model in models]
        used = rows.residual != 0.0  # neither left out nor before the filters had settled
        found.append(Residuals(name, rows.channel[used], rows.t[used], *columns[:, used]))
    return found


def _channels(
    bench: Bench, residuals: Sequence[Residuals], rng: np.random.Generator
) -> tuple[list[ChannelGain], Floats]:
    """Every channel, and draws (DRAWS,) of the sum of their gains; blocks of time are resampled, all channels alike."""
    blocks = [np.floor((item.t - item.t.min()) / BLOCK).astype(int) for item in residuals]
    first = np.cumsum([0, *(int(b.max()) + 1 for b in blocks)])
    block = np.concatenate([b + f for b, f in zip(blocks, first, strict=False)])
    channel, before, after, every, floor = (
        np.concatenate([getattr(item, name) for item in residuals])
        for name in ("channel", "before", "after", "everything", "floor")
    )
    weights = rng.multinomial(first[-1], np.full(first[-1], 1.0 / first[-1]), DRAWS)  # (DRAWS, blocks)
    found, total = [], np.zeros(DRAWS)
    for number, about in bench.channels.items():
        at = channel == number
        if not at.any():
            continue
        sums = [np.bincount(block[at], values[at] ** 2, first[-1]) for values in (before, after)]
        drawn = [weights @ s for s in sums]
        gains = 0.5 * (drawn[0] - drawn[1])
        total += gains
        scale, unit = bench.baseline.noise.get(about.name, (1.0, "std"))
        was, now, all_of_it, least = (
            scale * float(np.sqrt(np.mean(values[at] ** 2))) for values in (before, after, every, floor)
        )
        ratio = np.sqrt(drawn[1] / np.maximum(drawn[0], 1e-300))
        found.append(
            ChannelGain(
                about.name,
                unit,
                was,
                now,
                all_of_it,
                least,
                _ci(ratio),
                0.5 * float(sums[0].sum() - sums[1].sum()),
                _ci(gains),
                int(at.sum()),
            )
        )
    return found, total


def _ci(draws: Floats) -> tuple[float, float]:
    low, high = np.percentile(draws, LEVEL)
    return float(low), float(high)


def _about(gained: float, draws: Floats) -> tuple[float, float]:
    """The scatter of the resampled sum about the exact gain: in proportion, as tolerances take their share of each."""
    mean = float(np.mean(draws))
    return _ci(draws * (gained / mean)) if mean > 0.0 and gained > 0.0 else _ci(draws - mean + gained)
