"""Blind tests of the diagnosis in numbers: false alarms, detection, names, intervals, pairs, unknowns, stress, time.

python -m benchmarks.blind [PART ...] [--vehicle all|raptor90|quadrotor|rig] [--share 1.0] [--workers 2]
                           [--skip 0] [--duration 60] [-o blind] [--tables]

Every set is drawn from a seed, flown, sealed, diagnosed from what was measured, and only then opened
(tests/blind, benchmarks/blind_judge.py). Each result is a file of its own, so that a run that was stopped goes on where
it was. --share takes so much of every part's number, --skip leaves out the first of it; --tables only sums up what is
there. Writes summary.md, detection.png, results/.
"""

import argparse
import hashlib
import json
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from pathlib import Path

from benchmarks import blind_figures
from benchmarks.blind_judge import Job, Record, run
from flightlog.flight_json import plain
from helideck.show import campaign_progress
from identification.causes import CATALOGUE
from identification.multirotor.causes import catalogue
from sim.kinds import load
from sim.multirotor import Multirotor
from sim.rig import Rig
from tests.blind.kits import file_of, kit_of

Names = tuple[str, ...]


@dataclass(frozen=True)
class Fleet:
    """Vehicles of one kind, and what is tried with them."""

    vehicles: Names
    first: int  # seed
    hard: Mapping[str, tuple[Names, Names]]  # either of a pair that looks alike: which, and plans
    thin: tuple[tuple[str, Names], ...] = ()  # vehicle, and topics that its log lacks


FLEETS: Mapping[str, Fleet] = {
    "raptor90": Fleet(
        ("raptor90",), 0,
        {
            "ground_effect/baro_downwash": (("ground_effect", "baro_downwash"), ("ladder", "landing", "descents")),
            "sonar_scale/camera_focal": (("sonar_scale", "camera_focal"), ("ladder", "landing", "doublets")),
            "fuel_burn/thrust_scale": (("fuel_burn", "thrust_scale"), ("ladder", "doublets", "turn")),
            "clock_offset/actuator_delay": (("clock_offset", "actuator_delay"), ("doublets", "box", "turn")),
            "wind/cg_offset": (("wind", "cg_offset"), ("turn", "doublets", "box")),
        },
        tuple(("raptor90", left) for left in (("pad", "sonar"), ("pad", "mag"), ("gps",), ("baro", "sonar"))),
    ),
    "quadrotor": Fleet(
        ("quad", "crazyflie"), 1_000_000,
        {"battery_sag/mass": (("battery_sag", "mass"), ("ladder", "turn", "doublets"))},
        (("quad", ("imu",)), ("quad_speed", ("imu", "battery")), ("crazyflie", ("imu",))),
    ),
    "rig": Fleet(("gimbal",), 2_000_000, {}),
}  # fmt: skip


@cache
def known(vehicle: str) -> Names:
    """Effects that the injector has for a vehicle and the catalogue a name."""
    craft = load(file_of(vehicle))
    if isinstance(craft, Multirotor):
        named = {cause.title for cause in catalogue(craft)}
        if craft.by_speed:  # a speed that is measured knows neither
            named -= {"battery_sag", "actuator_lag", "actuator_delay"}
    else:
        named = set(kit_of(vehicle).effects) if isinstance(craft, Rig) else set(CATALOGUE)
    return tuple(name for name in kit_of(vehicle).effects if name in named)


def _nulls(fleet: Fleet, count: int, first: int, part: str, stress: bool = False) -> Iterator[Job]:
    for i in range(count):
        yield Job(part, fleet.first + first + i, "null", vehicle=fleet.vehicles[i % len(fleet.vehicles)], stress=stress,
                  heldout=0)  # fmt: skip


def _singles(fleet: Fleet, count: int) -> Iterator[Job]:
    for j, vehicle in enumerate(fleet.vehicles):
        for i, name in enumerate(known(vehicle)):
            for k in range(count):
                yield Job("single", fleet.first + 30_000 + 4_000 * j + 100 * i + k, "single", (name,), vehicle=vehicle)


def _pairs(fleet: Fleet, count: int) -> Iterator[Job]:
    for i in range(count):
        vehicle = fleet.vehicles[i % len(fleet.vehicles)]
        names = known(vehicle)
        a = names[(7 * i) % len(names)]
        b = names[(7 * i + 1 + i // len(names) % (len(names) - 1)) % len(names)]
        yield Job("pair", fleet.first + 40_000 + i, "pair", (a, b), vehicle=vehicle)


def _unknowns(fleet: Fleet, count: int) -> Iterator[Job]:
    for j, vehicle in enumerate(fleet.vehicles):
        for i, name in enumerate(kit_of(vehicle).unknown):
            for k in range(count):
                yield Job("unknown", fleet.first + 50_000 + 1_000 * j + 100 * i + k, "unknown", (name,),
                          vehicle=vehicle)  # fmt: skip


def _left_out(fleet: Fleet, count: int) -> Iterator[Job]:
    for j, vehicle in enumerate(fleet.vehicles):
        for i, name in enumerate(known(vehicle)):
            for k in range(count):
                yield Job("left out", fleet.first + 55_000 + 4_000 * j + 100 * i + k, "single", (name,),
                          vehicle=vehicle, leave_out=name)  # fmt: skip


def _weak(fleet: Fleet, count: int) -> Iterator[Job]:
    for i in range(count):
        vehicle = fleet.vehicles[i % len(fleet.vehicles)]
        names = known(vehicle)
        yield Job("weak", fleet.first + 65_000 + i, "weak", (names[i // len(fleet.vehicles) % len(names)],),
                  vehicle=vehicle)  # fmt: skip


def _hard(fleet: Fleet, count: int) -> Iterator[Job]:
    for i, (which, plans) in enumerate(fleet.hard.values()):
        for k in range(count):
            vehicle, name = fleet.vehicles[k // len(which) % len(fleet.vehicles)], which[k % len(which)]
            if name in known(vehicle):
                yield Job("hard", fleet.first + 70_000 + 100 * i + k, "single", (name,), vehicle=vehicle, plans=plans)


def _stress(fleet: Fleet, count: int) -> Iterator[Job]:
    yield from _nulls(fleet, count, 80_000, "stress null", stress=True)
    for i in range(count // 2):
        vehicle = fleet.vehicles[i % len(fleet.vehicles)]
        names = known(vehicle)
        yield Job("stress single", fleet.first + 81_000 + i, "single", (names[i // len(fleet.vehicles) % len(names)],),
                  vehicle=vehicle, stress=True)  # fmt: skip


def _thin(fleet: Fleet, count: int) -> Iterator[Job]:
    """Logs that lack some sensors, as most real ones do."""
    for i in range(count if fleet.thin else 0):
        vehicle, left = fleet.thin[i // 2 % len(fleet.thin)]
        names = [name for name in known(vehicle) if not _needed(vehicle, name) & set(left)]
        yield Job("thin", fleet.first + 90_000 + i, "null" if i % 2 else "single",
                  None if i % 2 else (names[i // 2 % len(names)],), vehicle=vehicle, without=left,
                  heldout=0)  # fmt: skip


def _needed(vehicle: str, name: str) -> set[str]:
    """Topics without which an effect cannot be seen."""
    import numpy as np

    kit, rng = kit_of(vehicle), np.random.default_rng(0)
    return set(kit.effect(kit.effects[name], kit.draw(rng), rng, 1.0).needs)


# number at --share 1: nulls, nulls for the threshold, eight of each entry, ...
PARTS: Mapping[str, tuple[Callable[[Fleet, int], Iterator[Job]], int]] = {
    "null": (lambda fleet, n: _nulls(fleet, n, 10_000, "null"), 300),
    "threshold": (lambda fleet, n: _nulls(fleet, n, 20_000, "threshold"), 500),
    "single": (_singles, 8),
    "pair": (_pairs, 60),
    "unknown": (_unknowns, 10),
    "left out": (_left_out, 2),
    "weak": (_weak, 60),
    "hard": (_hard, 12),
    "stress": (_stress, 100),
    "thin": (_thin, 24),
}


def _fresh(part: str, fleet: Fleet, count: int, skip: int) -> list[Job]:
    """So many of a part's jobs, after those that it has with `skip`."""
    draw, _ = PARTS[part]
    seen = set(draw(fleet, skip)) if skip else set()
    return [job for job in draw(fleet, skip + count) if job not in seen]


def main(arguments: Sequence[str] | None = None) -> int:
    """See the module's own words."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; default: all")
    parser.add_argument("--vehicle", choices=["all", *FLEETS], default="all")
    parser.add_argument("--share", type=float, default=1.0, help="of every part's number of sets")
    parser.add_argument("--skip", type=int, default=0, help="so many of each part's first seeds: those seen before")
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
            for name, fleet in FLEETS.items() if given.vehicle in ("all", name)
            for job in _fresh(part, fleet, max(1, round(PARTS[part][1] * given.share)), given.skip)
        ]
        judge(jobs, results, given.workers)
    records = [Record(**json.loads(path.read_text())) for path in sorted(results.glob("*.json"))]
    print(blind_figures.write(records, given.output, {v: name for name, fleet in FLEETS.items()
                                                      for v in (*fleet.vehicles, *(v for v, _ in fleet.thin))}))
    return 0


def judge(jobs: Sequence[Job], results: Path, workers: int) -> None:
    """Run what is not there yet; both cores, one set a worker."""
    from joblib import Parallel, delayed, parallel_config

    missing = [job for job in jobs if not _place(job, results).is_file()]
    missing.sort(key=lambda job: _place(job, results).stem[-6:])  # a run that is stopped has seen something of all
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
