"""What these flights can show."""

import numpy as np

from identification.null import HOPELESS
from identification.report.drawing import AFTER, BEFORE, QUIET, canvas, png, rows_of
from identification.report.findings import Findings, label
from identification.report.power import power

TITLE = "What these flights could show"
CAPTION = (
    "d' of every cause at its usual size: by how many standard deviations it would stand out. Below 3 (red line) it "
    "cannot be told from nothing on these flights; beyond 10 (dotted) it can hardly be missed."
)


def draw(findings: Findings) -> bytes | None:
    """The strongest parameter of each cause."""
    if findings.diagnosis is None:
        return None
    best: dict[str, float] = {}
    for item in power(findings.diagnosis):
        best.setdefault(item.cause, item.strength)
    if not best:
        return None
    figure, axes = canvas(8.0, 0.9 + 0.22 * len(best))
    place = axes[0, 0]
    y = rows_of(place, [label(name) for name in best])
    values = np.maximum(list(best.values()), 0.1)
    place.barh(y, values, color=[AFTER if v >= HOPELESS else "#e6b8a8" for v in values])
    place.axvline(HOPELESS, lw=1.0, color=BEFORE)
    place.axvline(10.0, lw=0.8, ls=":", color=QUIET)
    place.set_xscale("log")
    place.xaxis.set_major_formatter("{x:g}")
    place.set_xlabel("d' at its usual size")
    return png(figure)
