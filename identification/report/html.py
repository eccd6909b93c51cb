"""The report as one HTML page, its pictures inside."""

import base64
from collections.abc import Sequence
from pathlib import Path

from identification.report.findings import Findings, sentence
from identification.report.panels import Panel
from identification.report.tables import Table


def write_html(findings: Findings, drawn: Sequence[Panel], made: Sequence[Table], path: Path) -> None:
    """Write the page; it needs no other file."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("identification.report", "."), autoescape=True, undefined=StrictUndefined
    )
    page = environment.get_template("page.html.j2").render(
        sentence=sentence(findings.verdict), verdict=findings.verdict, panels=drawn, tables=made,
        embed=lambda panel: base64.b64encode(panel.png).decode(),
    )  # fmt: skip
    path.write_text(page, encoding="utf-8")
