"""Effects that nobody foresaw, over blind sets: what nulls reach, what is found, how good the curve is.

    python -m benchmarks.unknown null --sets 40            # the thresholds of identification/unknown/null.py
    python -m benchmarks.unknown low_push speed_lift soft_ground --sets 8
    python -m benchmarks.unknown ground_effect drag --sets 4     # taken out of the catalogue

One line of JSON a set goes to the file, from which a stopped run goes on.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.blind_judge import without
from flightlog.readers.folder import read_flight
from identification.diagnosis import open_bench
from identification.helicopter import HelicopterBench
from identification.search import Search
from identification.unknown.finding import find
from identification.unknown.opening import open_bank
from sim import vehicle as vehicles
from tests.blind.effects import UNKNOWN
from tests.blind.injector import Kind, make

RATE = 0.002  # of nulls that may raise an alarm, in any group


def judge(what: str, seed: int, flights: int, duration_s: float) -> dict[str, Any]:
    """One set: made, diagnosed with its cause out of the catalogue, and what was found."""
    kind: Kind = "null" if what == "null" else "unknown" if what in UNKNOWN else "single"
    nominal = vehicles.load("raptor90")
    with TemporaryDirectory(prefix="unknown-") as place:
        folder = Path(place) / "set"
        names = None if what == "null" else [what]
        made = make(seed, kind, folder, Path(place) / "answers", names=names, flights=flights, duration_s=duration_s)
        logs = {path.name: read_flight(path, truth=False).measured for path in made.flights}
    started = time.perf_counter()
    with threadpool_limits(1), without(what if kind == "single" else None):
        bench = open_bench(logs, nominal)
        search = Search(bench, HelicopterBench.threshold)
        best = search.run()
        searched = time.perf_counter()
        outcome = find(search, best)
    bank = open_bank(bench)
    groups: dict[str, tuple[float, str, str]] = {}
    assert bank is not None
    for (way, driver), item in outcome.scanned.items():
        group = bank.ways[way].group
        if group not in groups or item.nats > groups[group][0]:
            groups[group] = (round(item.nats, 2), way, driver)
    return {
        "what": what, "seed": seed, "named": list(best), "kept": list(outcome.causes),
        "gain": round(search.gain(best), 1), "groups": groups,
        "found": [
            {"channel": f.way.name, "depends_on": f.depends_on, "nats": round(f.nats, 1), "strength": f.strength,
             "form": f.form.text if f.form else None, "x": f.x.tolist(), "value": f.values.tolist()}
            for f in outcome.found
        ],
        "search_s": round(searched - started, 1), "find_s": round(time.perf_counter() - searched, 1),
    }  # fmt: skip


def threshold(values: Sequence[float], groups: int) -> float:
    """[nats] that a group's largest evidence exceeds in RATE / groups of the nulls, by Gumbel's tail."""
    spread = float(np.std(values)) * np.sqrt(6.0) / np.pi
    middle = float(np.mean(values)) - 0.5772 * spread
    return float(middle - spread * np.log(-np.log1p(-RATE / groups)))


def told(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """The figures in lines."""
    nulls = [row for row in rows if row["what"] == "null"]
    names = sorted({group for row in nulls for group in row["groups"]})
    for name in names:
        values = [row["groups"][name][0] for row in nulls if name in row["groups"]]
        if len(values) > 2:
            limit = threshold(values, len(names))
            yield f"{name:8} nulls {len(values)}: largest {max(values):.1f}, threshold {limit:.1f}"
    for what in dict.fromkeys(row["what"] for row in rows):
        own = [row for row in rows if row["what"] == what]
        flagged = [row for row in own if row["found"]]
        line = f"{what:16} sets {len(own)}: flagged {len(flagged)}"
        if what in UNKNOWN:
            _, channel, driver = UNKNOWN[what]
            right = [row for row in flagged if any(f["channel"] == channel for f in row["found"])]
            driven = [
                row for row in right
                if any(f["channel"] == channel and driver in f["depends_on"] for f in row["found"])
            ]  # fmt: skip
            line += f", channel {len(right)}, driver {len(driven)}"
        else:
            line += ": " + ", ".join(f"{f['channel']} over {f['depends_on'][0]}" for r in flagged for f in r["found"])
        yield line


def main() -> int:
    """Run what is missing; print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="+", help="null, an unknown effect, or a cause to be taken out of the catalogue")
    parser.add_argument("--sets", type=int, default=8)
    parser.add_argument("--first", type=int, default=9000, help="first seed")
    parser.add_argument("--flights", type=int, default=2)
    parser.add_argument("--duration", type=float, default=45.0)
    parser.add_argument("-o", "--output", type=Path, default=Path("unknown.jsonl"))
    given = parser.parse_args()
    lines = given.output.read_text().splitlines() if given.output.exists() else []
    rows = [json.loads(line) for line in lines]
    done = {(row["what"], row["seed"]) for row in rows}
    for what in given.what:
        for seed in range(given.first, given.first + given.sets):
            if (what, seed) in done:
                continue
            rows.append(judge(what, seed, given.flights, given.duration))
            with given.output.open("a") as file:
                file.write(json.dumps(rows[-1]) + "\n")
            print(f"{what} {seed}: {[(f['channel'], f['depends_on']) for f in rows[-1]['found']]}", file=sys.stderr)
    print("\n".join(told(rows)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
