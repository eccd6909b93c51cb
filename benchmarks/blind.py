"""Blind tests of the diagnosis in numbers: false alarms, detection, names, intervals, pairs, unknowns, stress, time.

python -m benchmarks.blind [PART ...] [--share 1.0] [--workers 2] [--duration 60] [-o blind] [--tables]

Every set is drawn from a seed, flown, sealed, diagnosed from what was measured, and only then opened
(tests/blind, benchmarks/blind_judge.py). Each result is a file of its own, so that a run that was stopped goes on where
it was. --share takes so much of every part's number; --tables only sums up what is there. Writes summary.md,
detection.png, results/.
"""

import argparse
import hashlib
import json
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path

from benchmarks import blind_figures
from benchmarks.blind_judge import Job, Record, run
from flightlog.flight_json import plain
from helideck.show import campaign_progress
from identification.causes import CATALOGUE
from tests.blind.effects import EFFECTS, UNKNOWN

HARD: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {  # either of a pair that looks alike: which, and plans
    "ground_effect/baro_downwash": (("ground_effect", "baro_downwash"), ("ladder", "landing", "descents")),
    "sonar_scale/camera_focal": (("sonar_scale", "camera_focal"), ("ladder", "landing", "doublets")),
    "fuel_burn/thrust_scale": (("fuel_burn", "thrust_scale"), ("ladder", "doublets", "turn")),
    "clock_offset/actuator_delay": (("clock_offset", "actuator_delay"), ("doublets", "box", "turn")),
    "wind/cg_offset": (("cg_offset",), ("turn", "doublets", "box")),
}


def known() -> list[str]:
    """Effects that the catalogue has a name for."""
    return [name for name in EFFECTS if name in CATALOGUE]


def _nulls(count: int, first: int, part: str, stress: bool = False) -> Iterator[Job]:
    for i in range(count):
        yield Job(part, first + i, "null", stress=stress)


def _singles(count: int) -> Iterator[Job]:
    for i, name in enumerate(known()):
        for k in range(count):
            yield Job("single", 30_000 + 100 * i + k, "single", (name,))


def _pairs(count: int) -> Iterator[Job]:
    names = known()
    for i in range(count):
        a = names[(7 * i) % len(names)]
        b = names[(7 * i + 3 + 5 * (i // len(names))) % len(names)]
        if a != b:
            yield Job("pair", 40_000 + i, "pair", (a, b))


def _unknowns(count: int) -> Iterator[Job]:
    for i, name in enumerate(UNKNOWN):
        for k in range(count):
            yield Job("unknown", 50_000 + 100 * i + k, "unknown", (name,))


def _left_out(count: int) -> Iterator[Job]:
    for i, name in enumerate(known()):
        for k in range(count):
            yield Job("left out", 55_000 + 100 * i + k, "single", (name,), leave_out=name)


def _weak(count: int) -> Iterator[Job]:
    names = known()
    for i in range(count):
        yield Job("weak", 60_000 + i, "weak", (names[i % len(names)],))


def _hard(count: int) -> Iterator[Job]:
    for i, (which, plans) in enumerate(HARD.values()):
        for k in range(count):
            name = which[k % len(which)]
            if name in CATALOGUE:
                yield Job("hard", 70_000 + 100 * i + k, "single", (name,), plans=plans)


def _stress(count: int) -> Iterator[Job]:
    yield from _nulls(count, 80_000, "stress null", stress=True)
    names = known()
    for i in range(count // 2):
        yield Job("stress single", 81_000 + i, "single", (names[i % len(names)],), stress=True)


def _thin(count: int) -> Iterator[Job]:
    """Logs that lack some sensors, as most real ones do."""
    for i in range(count):
        left = (("pad", "sonar"), ("pad", "mag"), ("gps",), ("baro", "sonar"))[i % 4]
        yield Job("thin", 90_000 + i, "null" if i % 2 else "single", without=left)


# number at --share 1: nulls, nulls for the threshold, eight of each entry, ...
PARTS: Mapping[str, tuple[Callable[[int], Iterator[Job]], int]] = {
    "null": (lambda n: _nulls(n, 10_000, "null"), 300),
    "threshold": (lambda n: _nulls(n, 20_000, "threshold"), 500),
    "single": (_singles, 8),
    "pair": (_pairs, 60),
    "unknown": (_unknowns, 10),
    "left out": (_left_out, 2),
    "weak": (_weak, 60),
    "hard": (_hard, 12),
    "stress": (_stress, 100),
    "thin": (_thin, 24),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """See the module's own words."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; default: all")
    parser.add_argument("--share", type=float, default=1.0, help="of every part's number of sets")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--duration", type=float, default=60.0, help="of a flight [s]")
    parser.add_argument("--flights", type=int, default=3, help="of a set")
    parser.add_argument("-o", "--output", type=Path, default=Path("blind"))
    parser.add_argument("--tables", action="store_true", help="judge nothing, sum up what is there")
    given = parser.parse_args(arguments)
    for part in given.parts:
        if part not in PARTS:
            parser.error(f"no part {part!r}; there are {', '.join(PARTS)}")
    results = given.output / "results"
    results.mkdir(parents=True, exist_ok=True)
    if not given.tables:
        jobs = [
            replace(job, duration_s=given.duration, flights=given.flights if job.plans is None else len(job.plans))
            for part in given.parts or PARTS
            for job in PARTS[part][0](max(1, round(PARTS[part][1] * given.share)))
        ]
        judge(jobs, results, given.workers)
    records = [Record(**json.loads(path.read_text())) for path in sorted(results.glob("*.json"))]
    print(blind_figures.write(records, given.output))
    return 0


def judge(jobs: Sequence[Job], results: Path, workers: int) -> None:
    """Run what is not there yet; both cores, one set a worker."""
    from joblib import Parallel, delayed, parallel_config

    missing = [job for job in jobs if not _place(job, results).is_file()]
    with campaign_progress("blind sets") as progress:
        progress(len(jobs) - len(missing), len(jobs))
        with parallel_config("loky", inner_max_num_threads=1):
            done = Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)(
                delayed(_one)(job, _place(job, results)) for job in missing
            )
            for count, line in enumerate(done, len(jobs) - len(missing) + 1):
                print(line, file=sys.stderr, flush=True)
                progress(count, len(jobs))


def _place(job: Job, results: Path) -> Path:
    """The file of a job's result; another set of options is another file."""
    rest = json.dumps(plain({f.name: getattr(job, f.name) for f in fields(job)}), sort_keys=True)
    return results / f"{job.key.replace(' ', '_')}-{hashlib.sha256(rest.encode()).hexdigest()[:6]}.json"


def _one(job: Job, place: Path) -> str:
    """Judge one set and write its result whole or not at all; a failure is a result too."""
    try:
        found = run(job)
    except Exception as failure:
        text = f"{type(failure).__name__}: {failure} ({traceback.extract_tb(failure.__traceback__)[-1].name})"
        found = Record(asdict(job), [], None, [], "", False, [], [], 0.0, {}, {}, [], error=text)
    draft = place.with_suffix(".part")
    draft.write_text(json.dumps(plain(found)))
    draft.replace(place)
    names = [item["name"] for item in found.asserted]
    return f"{job.key}: {found.error or names} in {found.wall_s:.1f} s"


if __name__ == "__main__":
    sys.exit(main())
