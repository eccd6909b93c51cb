"""Lei 2012, section 4.3: landing from (0, 0, 10) on the H."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from scenarios.campaign import Share, flight_row
from scenarios.experiments.contract import Effort, Figure, Job, Outcome, Plot, Series
from scenarios.flight import fly
from scenarios.load import load

NAME = "landing"
SYSTEM = "lei2012"
TITLE = "Landing on the H from 10 m"
ABOUT = (
    "The paper flew to (0, 0, 10), hovered, checked itself, came down on the fused height and touched down 3.24 m off. "
    "Here: a hundred landings on a plain 1 m H in the default weather (1.5 m/s, Dryden), on the pad camera's error "
    "model; as many on the published filter; and ten with rendered pictures beside the same ten seeds without, to see "
    "whether the model is right."
)

FLIGHTS = {"full": 100, "quick": 10}
FAITHFUL = {"full": 20, "quick": 4}
RENDERED = {"full": 10, "quick": 1}
CHUNK = 5
COMPARED = {
    "touchdown_east_m": "touchdown, east [m]",
    "touchdown_north_m": "touchdown, north [m]",
    "touchdown_offset_m": "touchdown, distance [m]",
    "touchdown_sink_m_s": "sink at touchdown [m/s]",
    "touchdown_drift_m_s": "drift at touchdown [m/s]",
    "late_speed_max_m_s": "largest late speed [m/s]",
    "max_roll_deg": "largest roll [deg]",
    "max_pitch_deg": "largest pitch [deg]",
    "fused_height_mean_error_m": "fused height, mean error [m]",
    "fused_height_std_m": "fused height, deviation [m]",
}
LEAST = 0.01  # p below which mean or spread differ

Row = dict[str, Any]


def land(seeds: Sequence[int], kind: str) -> list[Row]:
    """Rows as `helideck land --json` has them."""
    settings: dict[str, Any] = {"navigator": "lei2012", "variant": "published" if kind == "published" else "helideck"}
    if kind == "paired":
        settings["sensors.pad.scale_std"] = 0.0  # the renderer's focal length is the one that is known aboard
    rendered = kind == "rendered"
    if rendered:
        settings |= {f"cameras.{name}.rate_hz": 1.0 for name in ("forward_a", "forward_b")}  # they do not matter here
    scenario = load("landing", settings)
    return [flight_row(fly(scenario, seed=(6, seed), cameras=rendered)) for seed in seeds]


def _plan(effort: Effort) -> list[tuple[tuple[int, ...], str]]:
    def chunks(number: int, size: int) -> list[tuple[int, ...]]:
        return [tuple(range(first, min(first + size, number))) for first in range(0, number, size)]

    plan = [(seeds, "rendered") for seeds in chunks(RENDERED[effort], 1)]
    plan += [(seeds, "ours") for seeds in chunks(FLIGHTS[effort], CHUNK)]
    plan += [(seeds, "published") for seeds in chunks(FAITHFUL[effort], CHUNK)]
    return plan + [(seeds, "paired") for seeds in chunks(RENDERED[effort], CHUNK)]


def jobs(effort: Effort) -> Sequence[Job]:
    """One a rendered flight, five a job of the others."""
    return [
        Job(land, part, f"landing, {part[1]}", 45.0 if part[1] == "rendered" else 1.5 * len(part[0]))
        for part in _plan(effort)
    ]


def _column(rows: Sequence[Row], name: str) -> np.ndarray:
    return np.array([np.nan if row[name] is None else row[name] for row in rows], float)


def compare(rendered: Sequence[Row], paired: Sequence[Row]) -> list[Row]:
    """Mean and spread of two sets of flights: Welch's t test and Levene's, with the bootstrap interval of the means."""
    rng = np.random.default_rng(0)
    table = []
    for name, title in COMPARED.items():
        a, b = (x[np.isfinite(x)] for x in (_column(rendered, name), _column(paired, name)))
        row: Row = {"quantity": title, "rendered": None, "model": None, "difference, 95 %": None, "same mean, p": None,
                    "same spread, p": None}  # fmt: skip
        if len(a) > 2 and len(b) > 2:
            gaps = [rng.choice(a, len(a)).mean() - rng.choice(b, len(b)).mean() for _ in range(2000)]
            low, high = np.percentile(gaps, [2.5, 97.5])
            row |= {
                "rendered": f"{a.mean():.4f} +- {a.std(ddof=1):.4f}", "model": f"{b.mean():.4f} +- {b.std(ddof=1):.4f}",
                "difference, 95 %": f"{low:.4f} .. {high:.4f}",
                "same mean, p": round(float(stats.ttest_ind(a, b, equal_var=False).pvalue), 3),
                "same spread, p": round(float(stats.levene(a, b).pvalue), 3),
            }  # fmt: skip
        table.append(row)
    return table


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """Shares and largest values of all flights."""
    flown: dict[str, list[Row]] = {}
    for (_, kind), rows in zip(_plan(effort), answers, strict=True):
        flown.setdefault(kind, []).extend(rows)
    ours, theirs = flown["ours"], flown["published"]
    near = Share.of_runs(int(np.sum(_column(ours, "touchdown_offset_m") <= 0.10)), len(ours))

    def figure(name: str, column: str, paper: float | None, bar: float | None, note: str = "") -> Figure:
        values, faithful = _column(ours, column), _column(theirs, column)
        return Figure(name, "deg" if column.endswith("deg") else "m/s" if column.endswith("_s") else "m", paper,
                      float(np.nanmax(faithful)), float(np.nanmax(values)), bar=bar,
                      note=f"largest of all; median {np.nanmedian(values):.3f}, 95 % below "
                           f"{np.nanpercentile(values, 95):.3f}" + note)  # fmt: skip

    figures = [
        Figure(
            "landings within 0.10 m of the centre", "%", None,
            100.0 * float(np.mean(_column(theirs, "touchdown_offset_m") <= 0.10)), 100.0 * near.share, bar=95.0,
            at_most=False,
            note=f"{near.count} of {near.of}; 95 % interval {100 * near.low:.0f} .. {100 * near.high:.0f}",
        ),
        figure("touchdown, distance from the centre", "touchdown_offset_m", 3.24, None, "; the paper's is one flight"),
        figure("largest horizontal speed below 2 m", "late_speed_max_m_s", 0.40, 0.15),
        figure("largest roll", "max_roll_deg", 7.20, 5.0),
        figure("largest pitch", "max_pitch_deg", 4.56, 4.0),
        figure("sink at touchdown", "touchdown_sink_m_s", None, None),
        figure("fused height, mean error", "fused_height_mean_error_m", None, None),
    ]  # fmt: skip
    table = compare(flown["rendered"], flown["paired"])
    tested = [row for row in table if row["same mean, p"] is not None]
    worst = [row["quantity"] for row in tested if min(row["same mean, p"], row["same spread, p"]) < LEAST]
    verdict = (
        "too few rendered flights to compare (one in quick runs)" if not tested
        else f"mean and spread agree (p > {LEAST}) in all {len(tested)} quantities" if not worst
        else f"they differ (p < {LEAST}) in {', '.join(worst)}"
    )  # fmt: skip
    places = [
        Series(name, _column(rows, "touchdown_east_m"), _column(rows, "touchdown_north_m"), "points")
        for name, rows in (("error model", ours), ("published filter", theirs), ("rendered", flown["rendered"]))
    ]
    return Outcome(
        figures,
        [Plot("Where the skids touched first", "Body origin over the pad's centre; the paper touched down 2.74 m east "
              "and 1.73 m north of it.", "east [m]", "north [m]", places)],
        notes=[
            f"Landed: {sum(bool(r['landed']) for r in ours)} of {len(ours)} of ours, "
            f"{sum(bool(r['landed']) for r in theirs)} of {len(theirs)} on the published filter.",
            f"Rendered against the error model, the same {len(flown['rendered'])} seeds: {verdict}.",
            "The horizontal position is Helideck's in both variants: the paper says nothing of it.",
        ],
        tables=[("Rendered landings beside the pad camera's error model, the same seeds", table)],
    )  # fmt: skip
