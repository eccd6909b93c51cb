"""The reproduction as one JSON document."""

from dataclasses import asdict
from typing import Any

from helideck.reproduction.run import Reproduction


def as_document(reproduction: Reproduction) -> dict[str, Any]:
    """Plain numbers and texts; plots as their points, pictures left to the page."""
    return {
        "effort": reproduction.effort,
        "summary": reproduction.sentence,
        "wall_s": reproduction.seconds,
        "versions": reproduction.versions,
        "experiments": [
            {
                "system": result.experiment.SYSTEM,
                "name": result.experiment.NAME,
                "title": result.experiment.TITLE,
                "cpu_s": result.seconds,
                "error": result.error,
                "figures": [
                    asdict(figure) | {"reached": figure.reached, "reproduced": figure.reproduced}
                    for figure in (result.outcome.figures if result.outcome else ())
                ],
                "tables": [
                    {"title": title, "rows": list(rows)}
                    for title, rows in (result.outcome.tables if result.outcome else ())
                ],
                "plots": [
                    {
                        "title": plot.title,
                        "x": plot.x_label,
                        "y": plot.y_label,
                        "series": [{"label": s.label, "x": s.x, "y": s.y} for s in plot.series],
                    }
                    for plot in (result.outcome.plots if result.outcome else ())
                ],
                "notes": list(result.outcome.notes) if result.outcome else [],
            }
            for result in reproduction.results
        ],
    }
