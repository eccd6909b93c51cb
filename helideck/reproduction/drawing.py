"""Plots and pictures as PNG."""

import io

import cv2
import numpy as np

from scenarios.experiments.contract import Picture, Plot

COLOURS = ("#1f4e79", "#c8553d", "#3a7d44", "#8e6c8a", "#b08900", "#4a4a4a")


def plot_png(plot: Plot) -> bytes:
    """The plot drawn, 8 by 3.6 inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 3.6), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for (label, low, high), shade in zip(plot.bands, ("#bcd4e6", "#e3eef6", "#f3e6d8"), strict=False):
        axes.axhspan(low, high, color=shade, alpha=0.7, label=label, zorder=0)
    for k, series in enumerate(plot.series):
        colour = COLOURS[k % len(COLOURS)]
        if series.style == "points":
            axes.plot(series.x, series.y, ".", ms=4, color=colour, label=series.label)
        else:
            axes.plot(
                series.x, series.y, lw=1.2, color=colour, label=series.label,
                drawstyle="steps-post" if series.style == "steps" else "default",
            )  # fmt: skip
    if plot.log_y:
        axes.set_yscale("log")
    axes.set_xlabel(plot.x_label)
    axes.set_ylabel(plot.y_label)
    axes.set_title(plot.title, loc="left", fontsize=10)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=8, frameon=False)
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()


def picture_png(picture: Picture) -> bytes:
    """The picture itself."""
    image = np.ascontiguousarray(picture.image)
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_RGB2BGR).astype(np.uint8)
    done, data = cv2.imencode(".png", image)
    if not done:
        raise ValueError(f"picture {picture.title!r} of shape {image.shape} cannot be written as PNG")
    return data.tobytes()
