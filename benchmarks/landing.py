"""Rendered landings and hovers over many seeds, beside what they must show. Goes on where it was broken off.

python benchmarks/landing.py [--runs 100] [--hovers 3] [-o DIR] [--no-cameras] [--json]
"""

import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import pyarrow as pa
import tyro
from rich.console import Console
from rich.table import Table

from helideck.show import campaign_progress
from scenarios.campaign import Campaign, Share, run_campaign
from scenarios.load import load


@dataclass(frozen=True)
class Bar:
    """One figure that has to be reached."""

    name: str
    column: str
    most: float
    unit: str


LANDING = (
    Bar("offset from the H's centre", "touchdown_offset_m", 0.10, "m"),
    Bar("sink", "touchdown_sink_m_s", 0.5, "m/s"),
    Bar("drift", "touchdown_drift_m_s", 0.4, "m/s"),
    Bar("largest speed below 2 m", "late_speed_max_m_s", 0.15, "m/s"),
    Bar("largest roll", "max_roll_deg", 5.0, "deg"),
    Bar("largest pitch", "max_pitch_deg", 4.0, "deg"),
)
HOVER = (
    Bar("fused height, mean error", "fused_height_mean_error_m", 0.03, "m"),
    Bar("fused height, largest error", "fused_height_max_error_m", 0.10, "m"),
)


@dataclass(frozen=True)
class Options:
    """What to fly."""

    runs: int = 100  # about an hour
    hovers: int = 3
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("campaigns/benchmark")
    cameras: bool = True
    json: bool = False


def flown(scenario: str, runs: int, options: Options) -> pa.Table:
    campaign = Campaign(
        name=scenario, scenario=load(scenario), seed=0, vehicle="raptor90", vehicle_settings={}, aboard="raptor90",
        cameras=options.cameras,
    )  # fmt: skip
    folder = options.output / f"{scenario}-{'rendered' if options.cameras else 'blind'}"
    # a rendered flight takes two cores: its renderer is a process of its own
    workers = 1 if options.cameras else os.cpu_count() or 1
    with campaign_progress(scenario) as progress:
        return run_campaign(campaign, runs, folder, workers=workers, progress=progress)


def judged(table: pa.Table, bars: tuple[Bar, ...], also: Callable[[dict[str, object]], bool]) -> dict[str, object]:
    rows = table.to_pylist()
    good = [also(row) and all(row[b.column] is not None and row[b.column] <= b.most for b in bars) for row in rows]
    figures = {}
    for bar in bars:
        values = sorted(row[bar.column] for row in rows if row[bar.column] is not None)
        median, largest = (values[len(values) // 2], values[-1]) if values else (None, None)
        figures[bar.column] = {"bar": bar.most, "median": median, "max": largest}
    share = Share.of_runs(sum(good), len(good))
    return {"good": share.count, "of": share.of, "interval95": [share.low, share.high], "figures": figures,
            "bad_runs": [row["seed"] for row, fine in zip(rows, good, strict=True) if not fine]}  # fmt: skip


def show(title: str, verdict: dict, bars: tuple[Bar, ...]) -> None:
    console = Console(highlight=False)
    table = Table(title=f"{title}: {verdict['good']} of {verdict['of']} within all bars", title_justify="left")
    for name in ("", "bar", "median", "max"):
        table.add_column(name, justify="left" if not name else "right")
    for bar in bars:
        f = verdict["figures"][bar.column]
        numbers = ["-" if f[key] is None else f"{f[key]:.3f}" for key in ("median", "max")]
        table.add_row(f"{bar.name} [{bar.unit}]", f"{bar.most:g}", *numbers)
    console.print(table)
    if verdict["bad_runs"]:
        console.print(f"outside: {', '.join(verdict['bad_runs'])}")


def main() -> int:
    options = tyro.cli(Options, description=__doc__)
    report = {}
    if options.runs:
        table = flown("landing", options.runs, options)
        report["landing"] = judged(table, LANDING, lambda row: bool(row["landed"]))
    if options.hovers:
        report["hover"] = judged(flown("hover", options.hovers, options), HOVER, lambda row: row["error"] is None)
    if options.json:
        print(json.dumps(report, indent=2))
    else:
        for name, bars in (("landing", LANDING), ("hover", HOVER)):
            if name in report:
                show(f"{name}, {'rendered' if options.cameras else 'without cameras'}", report[name], bars)
    enough = {"landing": 0.95, "hover": 1.0}
    return 0 if all(v["good"] >= enough[name] * v["of"] for name, v in report.items()) else 1


if __name__ == "__main__":
    sys.exit(main())
