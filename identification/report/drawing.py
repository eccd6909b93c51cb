"""How the report's pictures look."""

import io
from collections.abc import Sequence
from typing import Any

import numpy as np

BEFORE, AFTER, BAND, QUIET = "#c8553d", "#1f4e79", "#e3eef6", "#8a8a8a"
DPI = 110


def canvas(width: float, height: float, rows: int = 1, columns: int = 1, **layout: Any) -> tuple[Any, Any]:
    """A figure [inch] and its axes (rows, columns), without a window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, **layout)
    for item in axes.ravel():
        item.grid(alpha=0.25)
        item.set_axisbelow(True)
        item.spines[["top", "right"]].set_visible(False)
    return figure, axes


def png(figure: Any) -> bytes:
    """The figure as a PNG file."""
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()


def said(unit: str) -> str:
    """A unit as it is printed."""
    return unit.replace("^2", "²").replace("^3", "³")


def rows_of(place: Any, labels: Sequence[str]) -> Any:
    """Lay one row a label from the top down; their heights (N,)."""
    y = np.arange(len(labels))[::-1]
    place.set_yticks(y, labels, fontsize=8)
    place.set_ylim(-0.7, len(labels) - 0.3)
    return y
