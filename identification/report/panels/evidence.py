"""What every candidate explains, alone over none."""

import numpy as np

from identification.report.drawing import AFTER, BEFORE, QUIET, canvas, png
from identification.report.findings import Findings

TITLE = "Evidence of every candidate"
CAPTION = (
    "Log Bayes factor of each cause alone over none, on all channels of all flights together; the line is the "
    "threshold, set for two false alarms in a thousand verdicts."
)
LEAST = 0.5  # [nats] shown at the left end of the logarithmic axis


def draw(findings: Findings) -> bytes | None:
    """A bar a candidate; asserted ones stand out."""
    candidates = [c for c in findings.verdict.candidates if np.isfinite(c.log_bayes_factor)]
    if not candidates:
        return None
    named = {c.name for c in findings.verdict.causes}
    alike = {other for c in findings.verdict.causes for other in c.confusable_with}
    figure, axes = canvas(8.0, 0.9 + 0.22 * len(candidates))
    place, y = axes[0, 0], np.arange(len(candidates))[::-1]
    values = np.array([max(c.log_bayes_factor, LEAST) for c in candidates])
    colours = [BEFORE if c.name in named else AFTER if c.name in alike else "#c9ced6" for c in candidates]
    place.barh(y, values, color=colours)
    place.set_xscale("log")
    place.set_xlim(LEAST, max(100.0, 1.5 * values.max()))
    place.set_yticks(y, [c.name for c in candidates], fontsize=8)
    if findings.diagnosis is not None:
        place.axvline(findings.diagnosis.search.threshold, lw=1.0, color=QUIET)
    place.set_xlabel("log Bayes factor over none [nats]; what is below the axis explains nothing")
    return png(figure)
