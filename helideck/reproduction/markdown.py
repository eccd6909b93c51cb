"""The reproduction as Markdown, its pictures in a folder beside it."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from helideck.reproduction.drawing import picture_png, plot_png
from helideck.reproduction.html import cell
from helideck.reproduction.run import SYSTEMS, Reproduction, bar_text, number, verdict
from scenarios.experiments.contract import Outcome
from scenarios.experiments.runner import Result


def write_markdown(reproduction: Reproduction, path: Path) -> None:
    """Write `path` and `figures/*.png` beside it."""
    folder = path.parent / "figures"
    folder.mkdir(exist_ok=True)
    lines = ["# The published experiments, run again", "", f"{reproduction.sentence}.", ""]
    for system, title in SYSTEMS.items():
        chapter = [result for result in reproduction.results if system == result.experiment.SYSTEM]
        if chapter:
            lines += [f"## {title}", ""]
        for result in chapter:
            lines += _section(result, folder)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _section(result: Result, folder: Path) -> Iterator[str]:
    yield from (f"### {result.experiment.TITLE}", "", result.experiment.ABOUT, "")
    if result.error is not None:
        yield from ("```", result.error.strip(), "```", "")
    outcome = result.outcome
    if outcome is None:
        return
    if outcome.figures:
        head = ("quantity", "unit", "published", "faithful", "ours", "bar", "bound", "")
        yield from _table(head, [_row(outcome, k) for k in range(len(outcome.figures))])
    for title, rows in outcome.tables:
        if rows:
            yield from (f"**{title}**", "")
            yield from _table(tuple(rows[0]), [tuple(map(cell, row.values())) for row in rows])
    stem = f"{result.experiment.SYSTEM}-{result.experiment.NAME}"
    drawn = [(item.title, item.caption, plot_png(item)) for item in outcome.plots]
    drawn += [(item.title, item.caption, picture_png(item)) for item in outcome.pictures]
    for k, (title, caption, png) in enumerate(drawn, 1):
        (folder / f"{stem}-{k}.png").write_bytes(png)
        yield from (f"![{title}](figures/{stem}-{k}.png)", "", f"{caption}", "")
    yield from (f"- {note}" for note in outcome.notes)
    yield ""


def _row(outcome: Outcome, k: int) -> tuple[str, ...]:
    f = outcome.figures[k]
    name = f"{f.quantity} ({f.note})" if f.note else f.quantity
    return (
        name, f.unit, number(f.published), number(f.faithful), number(f.ours), bar_text(f), number(f.bound), verdict(f)
    )  # fmt: skip


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(text.replace("|", "\\|") for text in cells) + " |"

    yield line(head)
    yield "|" + "---|" * len(head)
    yield from map(line, rows)
    yield ""
