"""What a flight was like, for people and for machines."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any

from rich.console import Console
from rich.table import Table

from helideck.reproduction.run import Reproduction, bar_text, number, verdict
from scenarios.campaign import CampaignSummary
from scenarios.flight import Flight


def as_document(flight: Flight | Mapping[str, Any]) -> dict[str, Any]:
    """The document of `land --json`; from a flight, or from what flight.json holds of it under `summary`."""
    figures = flight if isinstance(flight, Mapping) else asdict(flight)
    seed = figures["seed"]
    return {
        "scenario": figures["scenario"],
        "seed": seed[0] if len(seed) == 1 else list(seed),
        "vehicle": figures["vehicle"],
        **figures["summary"],
        **{name: figures[name] for name in ("wall_s", "startup_s", "real_time_factor", "renderer")},
        "flight": str(figures["folder"]) if figures["folder"] is not None else None,
    }


def print_summary(flight: Flight, stream: IO[str]) -> None:
    """The figures as a table, then where the files are."""
    s = flight.summary
    console = Console(file=stream, highlight=False)
    verdict = "success" if s.success else "no success"
    console.print(f"[bold]{flight.scenario}[/bold], seed {':'.join(map(str, flight.seed))}: {verdict}: {s.reason}")
    table = Table(show_header=False, box=None, pad_edge=False)
    if s.touchdown_offset_m is not None:
        table.add_row("touchdown", f"{s.touchdown_offset_m:.3f} m from the centre "
                      f"({s.touchdown_east_m:+.3f} east, {s.touchdown_north_m:+.3f} north)")  # fmt: skip
        table.add_row("", f"sinking {s.touchdown_sink_m_s:.2f} m/s, drifting {s.touchdown_drift_m_s:.2f} m/s")
    if s.late_speed_max_m_s is not None:
        table.add_row("below 2 m", f"at most {s.late_speed_max_m_s:.2f} m/s horizontal")
    if s.max_roll_deg is not None:
        table.add_row("largest tilt", f"roll {s.max_roll_deg:.1f} deg, pitch {s.max_pitch_deg:.1f} deg")
    if s.fused_height_mean_error_m is not None:
        table.add_row("fused height", f"mean error {s.fused_height_mean_error_m:.3f} m, max "
                      f"{s.fused_height_max_error_m:.3f} m, std {s.fused_height_std_m:.3f} m")  # fmt: skip
    for name, error in s.sensor_height_error_m.items():
        if error is not None:
            table.add_row(f"  {name} alone", f"mean {error['mean']:.3f} m, max {error['max']:.3f} m")
    table.add_row(
        "time",
        f"{s.duration_s:.1f} s flown in {flight.wall_s:.1f} s ({flight.real_time_factor:.1f} x real time), "
        f"{flight.startup_s:.1f} s to start",
    )
    table.add_row("renderer", flight.renderer or "none: pad camera's error model")
    if flight.folder is not None:
        table.add_row("written to", f"{flight.folder}  (helideck replay {flight.folder})")
    console.print(table)


def print_campaign(name: str, summary: CampaignSummary, folder: Path) -> None:
    """Shares with their 95 % intervals, and how the figures are spread."""
    console = Console(highlight=False)
    console.print(f"[bold]{name}[/bold]: {summary.runs} runs, {summary.failed} of them ended in an error")
    table = Table(box=None, pad_edge=False)
    for title in ("", "share", "95 % interval"):
        table.add_column(title)
    for title, share in (("success", summary.success), ("landed", summary.landed)):
        table.add_row(title, f"{share.count}/{share.of}", f"{100 * share.low:.1f} .. {100 * share.high:.1f} %")
    console.print(table)
    spread = Table(box=None, pad_edge=False)
    for title in ("", "median", "95 %", "max"):
        spread.add_column(title)
    for column, values in summary.quantiles.items():
        spread.add_row(column, *(f"{values[key]:.3f}" for key in ("median", "p95", "max")))
    console.print(spread)
    console.print(f"written to {folder / 'runs.parquet'}")


def print_reproduction(reproduction: Reproduction, page: Path, stream: IO[str]) -> None:
    """One table of all figures, then the sentence and where the page is."""
    console = Console(file=stream, highlight=False)
    for result in reproduction.results:
        console.print(f"[bold]{result.experiment.TITLE}[/bold]")
        if result.error is not None:
            console.print(result.error.strip().splitlines()[-1], style="red", markup=False)
        if result.outcome is None or not result.outcome.figures:
            continue
        table = Table(box=None, pad_edge=False)
        for title in ("", "published", "faithful", "ours", "bar", "bound", ""):
            table.add_column(title, justify="left" if not title else "right")
        for f in result.outcome.figures:
            figures = (number(f.published), number(f.faithful), number(f.ours), bar_text(f), number(f.bound))
            table.add_row(f"{f.quantity} [{f.unit}]".replace("[", "\\["), *figures, verdict(f))
        console.print(table)
    console.print(f"{reproduction.sentence}; {page}")


def print_estimation(document: Mapping[str, Any]) -> None:
    """What was estimated from a log, and what the log has to say of itself."""
    console = Console(highlight=False)
    console.print(f"[bold]{document['log']}[/bold]: {document['duration_s']:.1f} s by the navigator "
                  f"{document['navigator']} ({document['variant']})", soft_wrap=True)  # fmt: skip
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_row("used", ", ".join(document["topics_used"]))
    table.add_row("missing", ", ".join(document["topics_missing"]) or "nothing")
    if document["height"] is not None:
        table.add_row("height", f"{document['height']['min_m']:.2f} .. {document['height']['max_m']:.2f} m")
    rejected = ", ".join(f"{topic} {count}" for topic, count in document["rejected"].items())
    table.add_row("samples rejected", rejected or "none")
    for axis, error in (document["errors"] or {}).items():
        unit = "m" if len(axis) == 1 else "m/s" if len(axis) == 2 else "rad"
        table.add_row(f"error {axis}", f"mean {error['mean']:.3f}, max {error['max']:.3f}, std {error['std']:.3f}, "
                      f"rmse {error['rmse']:.3f} {unit} against {document['judged_by']}")  # fmt: skip
    table.add_row("written to", str(document["estimate"]))
    console.print(table)
    for note in document["notes"]:
        console.print(f"note: {note}", soft_wrap=True, markup=False)
