"""One blind set judged: flown and sealed, diagnosed from what was measured, the seal opened, both set side by side."""

import resource
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import numpy as np

from flightlog.readers.folder import read_flight
from identification.causes import CATALOGUE
from identification.diagnosis import Diagnosis, examine
from sim import vehicle as vehicles
from sim.vehicle import Vehicle
from tests.blind.injector import Answer, Kind, Set, make

MEGA = 1024.0  # kilobytes of ru_maxrss


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

    @property
    def key(self) -> str:
        """Name of its result."""
        return f"{self.part}-{'+'.join(self.names or ())}-{self.seed}" if self.names else f"{self.part}-{self.seed}"


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


def run(job: Job) -> Record:
    """Make the set in a place of its own, judge it, open the seal."""
    with TemporaryDirectory(prefix="blind-") as place:
        folder, answers = Path(place) / "set", Path(place) / "answers"
        made = make(
            job.seed, job.kind, folder, answers, names=job.names, vehicle=job.vehicle, plans=job.plans,
            flights=job.flights, duration_s=job.duration_s, without=job.without, stress=job.stress,
        )  # fmt: skip
        nominal = vehicles.load(job.vehicle)
        started = time.perf_counter()
        with without(job.leave_out):
            found = diagnosed(made, nominal)
        wall = time.perf_counter() - started
        return record(job, found, made.open(answers), made.seal, wall)


def diagnosed(made: Set, nominal: Vehicle) -> Diagnosis:
    """The verdict on a set, from its measured tables alone."""
    return examine({path.name: read_flight(path, truth=False).measured for path in made.flights}, nominal)


@contextmanager
def without(name: str | None) -> Iterator[None]:
    """The catalogue without one of its causes."""
    catalogue = cast(dict[str, Any], CATALOGUE)
    kept = dict(catalogue)
    if name is not None:
        catalogue.pop(name)
    try:
        yield
    finally:
        catalogue.clear()
        catalogue.update(kept)


def record(job: Job, found: Diagnosis, answer: Answer, seal: str, wall_s: float) -> Record:
    """Verdict and answer side by side."""
    verdict = found.verdict
    order = [candidate.name for candidate in verdict.candidates]
    named = {cause.name: cause for cause in verdict.causes}
    return Record(
        job=asdict(job),
        truth=[asdict(effect) for effect in answer.effects],
        shows=list(answer.shows) if answer.shows else None,
        plans=list(answer.plans),
        seal=seal,
        certified=verdict.baseline.certified,
        asserted=[
            {"name": c.name, "where": c.where, "probability": c.probability, "confusable_with": list(c.confusable_with),
             "split_by": c.split_by, "parameters": {k: asdict(p) for k, p in c.parameters.items()}}
            for c in verdict.causes
        ],
        unexplained=[asdict(item) for item in verdict.unexplained],
        best=max((c.log_bayes_factor for c in verdict.candidates), default=0.0),
        ranks={name: order.index(name) for name in answer.names if name in order},
        strength={e.name: d for e in answer.effects if (d := strength(found, e.name, e.values)) is not None},
        causes=[cause.name for cause in found.bench.causes],
        intervals=[
            {"cause": e.name, "parameter": key, "true": value, **asdict(named[e.name].parameters[key])}
            for e in answer.effects if e.name in named
            for key, value in e.values.items() if key in named[e.name].parameters
        ],
        wall_s=wall_s,
        memory_mb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEGA,
    )  # fmt: skip


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
