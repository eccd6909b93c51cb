"""The report of a diagnosis: a sentence, a picture, a table, then the rest; as HTML and as Markdown."""

from pathlib import Path

from identification.report.findings import Findings as Findings
from identification.report.findings import sentence as sentence


def write_report(findings: Findings, folder: Path) -> None:
    """Write report.html and report.md with its figures/."""
    from identification.report.html import write_html
    from identification.report.markdown import write_markdown
    from identification.report.panels import panels
    from identification.report.tables import tables

    drawn, made = panels(findings), tables(findings)
    write_html(findings, drawn, made, folder / "report.html")
    write_markdown(findings, drawn, made, folder / "report.md")
