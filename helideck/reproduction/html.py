"""The reproduction as one HTML page, its pictures inside."""

import base64
from pathlib import Path
from typing import Any

from helideck.reproduction.drawing import picture_png, plot_png
from helideck.reproduction.run import SYSTEMS, Reproduction, bar_text, number, verdict
from scenarios.experiments.contract import Picture, Plot


def write_html(reproduction: Reproduction, path: Path) -> None:
    """Write the page; it needs no other file."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("helideck.reproduction", "."), autoescape=True, undefined=StrictUndefined
    )
    chapters = {name: [r for r in reproduction.results if name == r.experiment.SYSTEM] for name in SYSTEMS}
    page = environment.get_template("page.html.j2").render(
        it=reproduction, systems=SYSTEMS, chapters=chapters, number=number, bar_text=bar_text, verdict=verdict,
        cell=cell, draw=_embedded,
    )  # fmt: skip
    path.write_text(page, encoding="utf-8")


def cell(value: Any) -> str:
    """What stands in a table's cell."""
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: ""}[value]
    return number(float(value)) if isinstance(value, int | float) else str(value)


def _embedded(item: Plot | Picture) -> str:
    return base64.b64encode(plot_png(item) if isinstance(item, Plot) else picture_png(item)).decode()
