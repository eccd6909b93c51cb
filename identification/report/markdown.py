"""The report as Markdown, its pictures beside it."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from identification.report.findings import Findings, sentence
from identification.report.panels import Panel
from identification.report.tables import Table, as_text


def write_markdown(findings: Findings, drawn: Sequence[Panel], made: Sequence[Table], path: Path) -> None:
    """Write the page; pictures go to figures/ beside it."""
    figures = path.parent / "figures"
    figures.mkdir(exist_ok=True)
    for panel in drawn:
        (figures / f"{panel.name}.png").write_bytes(panel.png)
    path.write_text("\n".join(_lines(findings, drawn, made)) + "\n", encoding="utf-8")


def _lines(findings: Findings, drawn: Sequence[Panel], made: Sequence[Table]) -> Iterator[str]:
    yield from ("# Diagnosis", "", sentence(findings.verdict), "")
    yield from (f"Logs: {', '.join(findings.verdict.logs)}", "")
    first, rest = drawn[:1], drawn[1:]
    for panel in first:
        yield from _picture(panel)
    for table in made[:2]:
        yield from _table(table)
    for panel in rest:
        yield from _picture(panel)
    for table in made[2:]:
        yield from _table(table)
    if findings.verdict.notes:
        yield from ("## About the logs", "", *(f"- {note}" for note in findings.verdict.notes), "")


def _picture(panel: Panel) -> Iterator[str]:
    yield from (f"## {panel.title}", "", f"![{panel.title}](figures/{panel.name}.png)", "", panel.caption, "")


def _table(table: Table) -> Iterator[str]:
    yield from (f"## {table.title}", "")
    if table.note:
        yield from (table.note, "")
    yield "| " + " | ".join(as_text(table.head)) + " |"
    yield "|" + "---|" * len(table.head)
    for row in table.rows:
        yield "| " + " | ".join(as_text(row)) + " |"
    yield ""
