"""The channel that gains most, along the flights."""

import numpy as np

from identification.gain import BLOCK
from identification.report.drawing import AFTER, BAND, BEFORE, canvas, png
from identification.report.findings import Findings

TITLE = "Along the flights"
CAPTION = "Evidence gained on held-out rows as the flight goes on, all channels; it should rise, not fall."
MOST = 6  # flights shown


def draw(findings: Findings) -> bytes | None:
    """Running sum of the log-likelihood gained."""
    gain = findings.gain
    if gain is None or not findings.verdict.causes:
        return None
    shown = gain.residuals[:MOST]
    figure, axes = canvas(8.0, 3.0)
    place = axes[0, 0]
    for i, item in enumerate(shown):
        order = np.argsort(item.t, kind="stable")
        t = item.t[order] - item.t[order[0]]
        gained = np.cumsum(0.5 * (item.before[order] ** 2 - item.after[order] ** 2))
        ticks = np.arange(0.0, t[-1] + BLOCK, 0.25 * BLOCK)
        place.plot(
            ticks, np.interp(ticks, t, gained), lw=1.3, color=AFTER if i % 2 == 0 else BEFORE, alpha=1.0 - 0.12 * i,
            label=item.flight,
        )  # fmt: skip
    place.axhline(0.0, color=BAND, lw=2.0, zorder=0)
    place.set_xlabel("time [s]")
    place.set_ylabel("log likelihood gained [nats]")
    place.legend(fontsize=8, frameon=False)
    return png(figure)
