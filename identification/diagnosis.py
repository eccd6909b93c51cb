"""From logs to the verdict, for every kind of vehicle."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module

import numpy as np
from threadpoolctl import threadpool_limits

from flightlog.errors import UserError
from flightlog.tables import Table
from identification import mistaken
from identification.bench import Bench, widened
from identification.classes import confusable, rivals, shares
from identification.counts import Counted, count
from identification.credible import contradicted, doubt
from identification.helicopter import HelicopterBench
from identification.null import THRESHOLD, UNJUDGED
from identification.regions import lost
from identification.search import Names, Search
from identification.told import told
from identification.unknown.finding import NOTHING, Found, find
from identification.verdict import (
    Asserted,
    BaselineReport,
    Candidate,
    Fitted,
    NotTestable,
    Number,
    Verdict,
)
from identification.widening import covariance
from sim.kinds import AnyVehicle

BENCHES: Mapping[str, str] = {
    "helicopter": "identification.helicopter",
    "multirotor": "identification.multirotor",
    "rig": "identification.rig",
}
LOOKS = 3  # further searches, each with what the one before found of sensors taken out of the measurements
FAR = 300.0  # [nats] from which on what is linear may mislead about which sensor is wrong
NEAR = 0.6  # of the best one's evidence, at which another is tried too
ALIKE = 5.0  # [nats] within which two are the same in another name
RIVALS = 2  # tried beside the best
SURE = 0.5  # probability of a cause or its class from which on it is asserted

Logs = Mapping[str, Mapping[str, Table]]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The verdict and all that it was taken from."""

    verdict: Verdict
    bench: Bench
    search: Search
    causes: Names  # in force together: of each class the most probable member
    unknown: Sequence[Found] = ()  # what no cause explains


def open_bench(logs: Logs, vehicle: AnyVehicle, like: Bench | None = None) -> Bench:
    """Prepare flights for the vehicle's kind; UserError where the logs cannot carry a diagnosis."""
    kind = str(vehicle.document["kind"])
    if kind not in BENCHES:
        raise UserError(f"{vehicle.path}: kind: found {kind!r}; {', '.join(BENCHES)} would be right")
    bench: Bench = import_module(BENCHES[kind]).open_bench(logs, vehicle, like)
    return bench


def diagnose(logs: Logs, vehicle: AnyVehicle, *, threshold: float | None = None) -> Verdict:
    """What the vehicle's model gets wrong on these flights, by name; see design section 6.

    logs: measured tables by flight and topic; threshold [nats]: instead of the bench's own. Raises UserError for a log
    that cannot carry a diagnosis.
    """
    found = examine(logs, vehicle, threshold=threshold)
    return told(found.verdict, found.search.causes)


def examine(logs: Logs, vehicle: AnyVehicle, *, threshold: float | None = None) -> Diagnosis:
    """`diagnose`, with all that the verdict was taken from."""
    with threadpool_limits(1, "blas"):  # its threads and ours would wait for each other
        return _examine(logs, vehicle, threshold)


def _examine(logs: Logs, vehicle: AnyVehicle, threshold: float | None) -> Diagnosis:
    bench = open_bench(logs, vehicle)
    search = _search(bench, threshold)
    certified = bench.baseline.certified
    best: Names = ()
    for further in reversed(range(LOOKS + 1)):
        if not certified:
            break
        best = search.run(partial(_misled, search) if further else None)
        anew = _likeliest(search, best) if further else None
        if anew is None:
            break
        bench, search = anew, _search(anew, threshold)
    beside = find(search, best) if certified else NOTHING
    best = beside.causes
    reason = (doubt(search, best) or _unfit(search, best, beside.explained)) if certified else bench.baseline.reason
    if reason is not None:
        best, beside = (), NOTHING
    _check_columns(logs, search, best, beside.found)
    causes = [_asserted(search, best, name) for name in best]
    causes = sorted((c for c in causes if c.probability > SURE), key=lambda c: -c.probability)
    counted = _counted(logs, bench) if reason is None else []
    verdict = Verdict(
        vehicle=vehicle.name,
        logs=list(bench.names),
        baseline=BaselineReport(
            reason is None,
            reason,
            {name: Number(value, unit) for name, (value, unit) in bench.baseline.noise.items()},
            bench.baseline.environment,
        ),
        channels=[],
        causes=[*causes, *(c.asserted() for c in counted if c.log_bayes_factor > search.threshold)],
        candidates=[*_candidates(search, best), *(c.candidate() for c in counted)],
        unexplained=[found.told() for found in beside.found],
        not_testable=[NotTestable(name, list(needs)) for name, needs in sorted(bench.not_testable.items())],
    )
    return Diagnosis(verdict, bench, search, best, beside.found)


def _search(bench: Bench, threshold: float | None) -> Search:
    return Search(bench, threshold if threshold is not None else float(getattr(bench, "threshold", THRESHOLD)))


def _misled(search: Search, best: Names) -> bool:
    """Whether flights are better prepared anew before the set grows.

    What a sensor's error does is not linear: a lag of half a second is found a fifth too small from where the file has
    it, and what is left over looks like others. So does what noise is taken for that is play.

    Not where it is the best of wrong explanations: what contradicts it is not to be taken for noise.
    """
    settled, fit = getattr(search.bench, "settled", None), search.fit(best)
    chosen = [search.causes[name] for name in best]
    return settled is not None and not settled(chosen, fit.values, fit.std) and not contradicted(search, best)


def _likeliest(search: Search, best: Names) -> Bench | None:
    """The flights prepared anew; where others come close and all are far from linear, with what then explains most.

    A mark 85 ms late looks at first more like an inertial sensor's clock; prepared about either, thousands tell.
    """
    found = _anew(search, best)
    if found is None or search.gain(best) < FAR or getattr(search.bench, "prepared_at", None):
        return found
    gains, least = [search.gain(best)], Search(found).null.cost
    for names in sorted(search.refits, key=lambda names: -search.gain(names)):
        gain = search.gain(names)
        if len(names) != len(best) or gain < NEAR * gains[0] or len(gains) > RIVALS:
            continue
        if min(abs(gain - other) for other in gains) > ALIKE and (other := _anew(search, names)) is not None:
            gains.append(gain)
            cost = Search(other).null.cost
            found, least = (other, cost) if cost < least else (found, least)  # the other one takes half a GiB
    return found


def _anew(search: Search, best: Names) -> Bench | None:
    """The flights prepared anew with what was found of their sensors taken out; None where there is no need."""
    prepare, fit = getattr(search.bench, "anew", None), search.fit(best)
    if prepare is None or not best or contradicted(search, best):
        return None
    found: Bench | None = prepare([search.causes[name] for name in best], fit.values, fit.std)
    return found


def _check_columns(logs: Logs, search: Search, best: Names, beside: Sequence[Found]) -> None:
    """UserError where what was found wrong with a sensor is a wrong column."""
    bench = search.bench
    if not isinstance(bench, HelicopterBench):
        return
    numbers = set(bench.sensor_channels)
    names = {channel.name for number, channel in bench.channels.items() if number in numbers}
    causes = [name for name in best if search.causes[name].changes is not None]
    curves = [found.told().channel for found in beside if found.told().channel in names]
    if causes or curves:
        said = ", ".join([*causes, *(f"something unknown in {channel}" for channel in dict.fromkeys(curves))])
        mistaken.check(logs, bench.vehicle, said, search.gain(best))


def _unfit(search: Search, best: Names, explained: float) -> str | None:
    """Why not even the best explanation may judge these flights; None where it may.

    explained [nats]: of log likelihood, by what is no cause.
    """
    fit = search.fit(best)
    size = 2.0 * (fit.cost - explained) / max(fit.stack.rows, 1)
    if size <= UNJUDGED:
        return None
    return f"innovations are {size:.2f} times as large as their noise (squared) under the best explanation"


def _counted(logs: Logs, bench: object) -> list[Counted]:
    """Causes that are events; of a helicopter, whose motion is known."""
    return count(logs, bench.flights, bench.vehicle) if isinstance(bench, HelicopterBench) else []


def _asserted(search: Search, best: Names, name: str) -> Asserted:
    scores = rivals(search, best, name)
    rest = tuple(n for n in best if n != name)
    _, probability = shares(scores, search.gain(rest))
    others = confusable(search, best, name)
    cause = search.causes[name]
    return Asserted(
        name=name,
        where=cause.where,
        probability=min(1.0, sum(probability[member] for member in (name, *others))),
        parameters=_parameters(search, best, name),
        gain=None,
        confusable_with=others,
        split_by=next((text for other in others if (text := cause.split_by.get(other.partition("#")[0]))), None),
    )


def _parameters(search: Search, best: Names, name: str) -> dict[str, Fitted]:
    fit, bench = search.fit(best), search.bench
    chosen = [search.causes[n] for n in best]
    stds = np.sqrt(np.diag(covariance(chosen, fit, bench.nominal, widened(bench))))
    std_of = dict(zip(fit.values, stds.tolist(), strict=True))
    found = {}
    for p in search.causes[name].parameters:
        value, std = fit.values[p.key], std_of[p.key]
        ends = value - 1.96 * std, value + 1.96 * std
        found[p.name] = Fitted(value, bench.nominal[p.key], std, ends, p.unit)
    return found


def _candidates(search: Search, best: Names) -> list[Candidate]:
    """Every cause alone over none; where causes are asserted also why each lost."""
    evidence = rivals(search, (), "")
    _, probability = shares(evidence, 0.0)
    ordered = sorted(evidence, key=lambda name: -evidence[name])
    return [
        Candidate(
            name, float(np.round(evidence[name], 3)), probability[name],
            None if not best or name in best else lost(search, best, name),
        )
        for name in ordered
    ]  # fmt: skip
