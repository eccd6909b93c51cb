"""One blind set judged: flown and sealed, diagnosed from what was measured, the seal opened, both set side by side."""

import resource
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from flightlog.readers.folder import read_flight
from identification import diagnosis
from identification.bench import Bench
from identification.diagnosis import Diagnosis, examine
from identification.normal import refit_to
from identification.search import Search
from identification.stack import stack
from sim.kinds import AnyVehicle, load
from sim.multirotor import Multirotor
from tests.blind.injector import Answer, Kind, Set, Told, make
from tests.blind.kits import file_of

MEGA = 1024.0  # kilobytes of ru_maxrss
NORMAL: Mapping[str, int] = {"crazyflie": 2}  # vehicles whose file says little, and how many flights to refit it to


@dataclass(frozen=True)
class Job:
    """One set to be made and judged."""

    part: str
    seed: int
    kind: Kind
    names: tuple[str, ...] | None = None
    vehicle: str = "raptor90"
    plans: tuple[str, ...] | None = None
    without: tuple[str, ...] = ()
    stress: bool = False
    leave_out: str | None = None  # a cause taken out of the catalogue before the diagnosis
    flights: int = 3
    duration_s: float = 60.0
    heldout: int = 1  # further flights, for the gain

    @property
    def key(self) -> str:
        """Name of its result."""
        return "-".join([self.part, self.vehicle, *(["+".join(self.names)] if self.names else []), str(self.seed)])


@dataclass(frozen=True)
class Record:
    """What came of a job; plain values, so that it can be written down."""

    job: dict[str, Any]
    truth: list[dict[str, Any]]  # name, where, form, values of each effect
    shows: list[str] | None
    plans: list[str]
    seal: str
    certified: bool
    asserted: list[dict[str, Any]]  # the verdict's causes
    unexplained: list[dict[str, Any]]
    best: float  # [nats] the best single cause over none, screened or refitted
    ranks: dict[str, int]  # by true effect, its place among the single causes, from 0
    strength: dict[str, float]  # by true effect with known values: d'
    causes: list[str]  # that were testable
    intervals: list[dict[str, Any]] = field(default_factory=list)  # of rightly named causes
    wall_s: float = 0.0  # of the verdict
    memory_mb: float = 0.0
    error: str | None = None
    gain: float | None = None  # [nats] on the held-out flights, what is asserted over nothing
    oracle: float | None = None  # [nats] what is true over nothing


def run(job: Job) -> Record:
    """Make the set in a place of its own, judge it, open the seal."""
    with TemporaryDirectory(prefix="blind-") as place:
        folder, answers = Path(place) / "set", Path(place) / "answers"
        made = make(
            job.seed, job.kind, folder, answers, names=job.names, vehicle=job.vehicle, plans=job.plans,
            flights=job.flights, heldout=job.heldout, normal=NORMAL.get(job.vehicle, 0), duration_s=job.duration_s,
            without=job.without, stress=job.stress,
        )  # fmt: skip
        nominal = load(file_of(job.vehicle))
        if made.normal:
            nominal = refit_to(nominal, logs(made.normal), Path(place) / "nominal.toml")
        started = time.perf_counter()
        with without(job.leave_out):
            found = examine(logs(made.flights), nominal)
            wall = time.perf_counter() - started
            return record(job, found, made, made.open(answers), nominal, wall)


def logs(flights: Sequence[Path]) -> dict[str, Any]:
    """Measured tables by flight and topic."""
    return {path.name: read_flight(path, truth=False).measured for path in flights}


@contextmanager
def without(name: str | None) -> Iterator[None]:
    """Diagnoses that do not know one of the causes."""
    opened = diagnosis.open_bench

    def fewer(*given: Any, **more: Any) -> Bench:
        bench = opened(*given, **more)
        bench.causes = [cause for cause in bench.causes if cause.title != name]
        return bench

    diagnosis.open_bench = fewer
    try:
        yield
    finally:
        diagnosis.open_bench = opened


def record(
    job: Job, found: Diagnosis, made: Set, answer: Answer, nominal: AnyVehicle, wall_s: float
) -> Record:
    """Verdict and answer side by side."""
    verdict = found.verdict
    true = {true_name(found, e.name, e.which): told(found, e, answer, made, nominal) for e in answer.effects}
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEGA
    gain, oracle = worth(found, made, nominal, true) if made.heldout else (None, None)
    order = [candidate.name for candidate in verdict.candidates]
    named = {cause.name: cause for cause in verdict.causes}
    return Record(
        job=asdict(job),
        truth=[asdict(e) | {"name": name} for e, name in zip(answer.effects, true, strict=True)],
        shows=list(answer.shows) if answer.shows else None,
        plans=list(answer.plans),
        seal=made.seal,
        certified=verdict.baseline.certified,
        asserted=[
            {"name": c.name, "where": c.where, "probability": c.probability, "confusable_with": list(c.confusable_with),
             "split_by": c.split_by, "parameters": {k: asdict(p) for k, p in c.parameters.items()}}
            for c in verdict.causes
        ],
        unexplained=[asdict(item) for item in verdict.unexplained],
        best=max((c.log_bayes_factor for c in verdict.candidates), default=0.0),
        ranks={name: order.index(name) for name in true if name in order},
        strength={name: d for name, v in true.items() if (d := strength(found, name, v)) is not None},
        causes=[cause.name for cause in found.bench.causes],
        intervals=[
            {"cause": name, "parameter": key, "true": value, **asdict(named[name].parameters[key])}
            for name, values in true.items() if name in named
            for key, value in values.items() if key in named[name].parameters
        ],
        wall_s=wall_s,
        memory_mb=memory,
        gain=gain,
        oracle=oracle,
    )  # fmt: skip


def told(found: Diagnosis, effect: Told, answer: Answer, made: Set, nominal: AnyVehicle) -> dict[str, float]:
    """The true values of an effect, as flights can tell them.

    Of a multirotor flights tell thrust over mass alone. Where the nominal file was refitted to flights of this very
    machine, it goes on having the mass that it was given, and the others count by that.
    """
    values = dict(effect.values)
    if made.normal and isinstance(nominal, Multirotor):
        heavier = answer.before["numbers"]["mass"] / nominal.mass
        name = true_name(found, effect.name, effect.which)
        keys = {p.name: p.key for p in found.search.causes[name].parameters} if name in found.search.causes else {}
        values |= {n: v / heavier for n, v in values.items() if keys.get(n) in ("mass", "terms.thrust.scale")}
    return values


def true_name(found: Diagnosis, name: str, which: str) -> str:
    """An effect by the search's name: one of several alike carries its rotor, joint or input."""
    full = f"{name}#{which}"
    return full if which and full in found.search.causes else name


def worth(
    found: Diagnosis, made: Set, nominal: AnyVehicle, true: Mapping[str, Mapping[str, float]]
) -> tuple[float | None, float | None]:
    """[nats] of held-out flights gained by what is asserted, and by the oracle: the true causes at their true values.

    A foreign form has no true values; its cause is then fitted to the held-out flights themselves. None where a true
    cause is not one of the search's.
    """
    bench, search = found.bench, found.search
    if not true or not found.verdict.baseline.certified or any(name not in search.causes for name in true):
        return None, None
    held = diagnosis.open_bench(logs(made.heldout), nominal, bench)
    known_there = {cause.name for cause in held.causes}
    if any(not values and name not in known_there for name, values in true.items()):
        return None, None  # these flights show nothing of it
    own = {name: [p.key for p in search.causes[name].parameters] for name in {*true, *found.causes}}
    touched = {key for keys in own.values() for key in keys}
    fitted = search.fit(found.causes)
    else_at = {key: value for key, value in fitted.at.items() if key not in touched}
    base = likelihood(held, else_at, {}, {})
    asserted = {key: (fitted.values[key], fitted.std[key]) for name in found.causes for key in own[name]}
    known: dict[str, tuple[float, float]] = {}
    for name, values in true.items():
        foreign = {} if values else Search(held).fit((name,)).values
        for p in search.causes[name].parameters:
            value = values.get(p.name, bench.nominal[p.key]) if values else foreign[p.key]
            known[p.key] = value, 0.0
    gains = [
        likelihood(held, else_at, {k: v for k, (v, _) in of.items()}, {k: s for k, (_, s) in of.items()}) - base
        for of in (asserted, known)
    ]
    return (gains[0] if found.causes else 0.0), gains[1]


def likelihood(
    bench: Bench, about: Mapping[str, float], values: Mapping[str, float], std: Mapping[str, float]
) -> float:
    """Log likelihood of a bench's flights with these numbers at `values`, known by `std`; all else integrated over.

    about: where the rest is linearised.
    """
    at = dict(about) | dict(values)
    rows = [bench.rows(i, at, set(at)) for i in range(len(bench.names))]
    s = stack(rows, list(rows[0].signatures))
    prior = np.array([{**bench.tolerances, **std}.get(key, 0.0) for key in s.keys])
    shift = np.array([about[key] - bench.nominal[key] if key in about else 0.0 for key in s.keys])
    used = np.flatnonzero(prior > 0.0)
    d, m = prior[used], shift[used]
    information, score = s.information[np.ix_(used, used)], s.score[used]
    square = s.square + 2.0 * m @ score + m @ information @ m
    b, inner = d * (score + information @ m), np.eye(len(used)) + d[:, None] * information * d
    return float(s.log_local - 0.5 * (square - b @ np.linalg.solve(inner, b)) - 0.5 * np.linalg.slogdet(inner)[1])


def strength(found: Diagnosis, name: str, values: Mapping[str, float]) -> float | None:
    """d': how far the true effect lies from all that may be off anyway, in standard deviations.

    From the information about the best null; where the effect's form has no value in the catalogue's terms, from the
    values that its cause fits best. None where the cause is not testable.
    """
    bench, search = found.bench, found.search
    if name not in search.causes:
        return None
    own = [p for p in search.causes[name].parameters if p.key in search.null.stack.keys]
    if not own:
        return None
    fitted = {} if values else search.fit((name,)).values
    delta = np.array(
        [values.get(p.name, bench.nominal[p.key]) - bench.nominal[p.key] if values
         else fitted[p.key] - bench.nominal[p.key] for p in own]
    )  # fmt: skip
    stack, keys = search.null.stack, [p.key for p in own]
    free = [key for key in stack.keys if bench.tolerances.get(key, 0.0) > 0.0 and key not in keys]
    scale = np.array([bench.tolerances[key] for key in free])
    i, j = stack.index(keys), stack.index(free)
    cross = stack.information[np.ix_(j, i)] * scale[:, None]
    inner = np.eye(len(free)) + scale[:, None] * stack.information[np.ix_(j, j)] * scale
    left = stack.information[np.ix_(i, i)] - cross.T @ np.linalg.solve(inner, cross)
    # what the parameters themselves may be off by without any cause
    within = np.diag([bench.tolerances.get(key, 0.0) ** 2 for key in keys])
    seen = np.linalg.solve(np.eye(len(keys)) + left @ within, left)
    return float(np.sqrt(max(delta @ seen @ delta, 0.0)))
