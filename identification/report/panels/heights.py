"""What redundant sensors say of the height: where no model is asked, and for causes that are events."""

import numpy as np
from numpy.typing import NDArray

from identification.parity.series import Heights, Series, collect
from identification.report.drawing import AFTER, BEFORE, QUIET, canvas, png
from identification.report.findings import Findings
from identification.report.telling import name_of

TITLE = "Height by every sensor"
CAPTION = "Each less its own median over the first seconds that all have in common. Red: the sensor that is blamed."
MOST = 3  # flights shown
BEGIN = 5.0  # [s]
POINTS = 3000  # of a line
COLOURS = (AFTER, "#5a9367", QUIET, "#8e6bb0", "#b08d3c")

Floats = NDArray[np.float64]


def draw(findings: Findings) -> bytes | None:
    """A picture for each flight."""
    wanted = findings.diagnosis is None or any(
        name_of(cause, findings.diagnosis) is None for cause in findings.verdict.causes
    )
    flights = {name: series(collect(tables)) for name, tables in findings.tables.items()} if wanted else {}
    shown = [(name, found) for name, found in flights.items() if len(found) > 1][:MOST]
    if not shown:
        return None
    blamed = {cause.topic or cause.name.partition("_")[0] for cause in findings.verdict.causes}
    figure, axes = canvas(max(4.2 * len(shown), 7.5), 3.8, 1, len(shown))
    for place, (name, found) in zip(axes[0], shown, strict=True):
        start, colours = max(s.t[0] for s in found.values()), iter(COLOURS)
        for topic, one in found.items():
            red = topic.split("_")[0] in blamed or topic in blamed
            early = one.value[(one.t >= start) & (one.t <= start + BEGIN)]
            level = float(np.median(early)) if len(early) else float(one.value[0])
            t, value = thinned(one)
            place.plot(
                t - min(s.t[0] for s in found.values()), value - level, lw=1.4 if red else 1.0, zorder=3 if red else 2,
                color=BEFORE if red else next(colours, QUIET), label=topic,
            )  # fmt: skip
        place.set_title(name, loc="left", fontsize=10)
        place.set_xlabel("time [s]")
        place.set_ylabel("height over the start [m]")
        place.legend(fontsize=8, frameon=False)
    return png(figure)


def series(heights: Heights) -> dict[str, Series]:
    """By topic."""
    return heights.levels | ({} if heights.sonar is None else {"sonar": heights.sonar})


def thinned(one: Series) -> tuple[Floats, Floats]:
    """At most POINTS rows; what jumps stays."""
    if len(one.t) <= POINTS:
        return one.t, one.value
    groups = np.array_split(np.arange(len(one.t)), POINTS // 2)
    ends = [{int(g[np.argmin(one.value[g])]), int(g[np.argmax(one.value[g])])} for g in groups]
    chosen = np.array(sorted(set().union(*ends)))
    return one.t[chosen], one.value[chosen]
