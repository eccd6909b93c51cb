"""What every candidate explains, alone over none."""

import numpy as np

from identification.report.drawing import AFTER, BEFORE, QUIET, canvas, png, rows_of
from identification.report.findings import Findings, candidates

TITLE = "Evidence of every candidate"
CAPTION = (
    "Log Bayes factor of each cause alone over none, on all channels of all flights together. Red: asserted; blue: not "
    "to be told from that; grey line: the evidence that a cause needs. Candidates that are not there explain nothing."
)
LEAST = 0.5  # [nats] shown at the left end of the logarithmic axis
MOST = 15  # candidates shown


def draw(findings: Findings) -> bytes | None:
    """A bar a candidate; asserted ones stand out."""
    shown = [(name, c) for name, c in candidates(findings) if c.log_bayes_factor > LEAST][:MOST]
    if not shown:
        return None
    named = {c.name for c in findings.verdict.causes}
    alike = {other for c in findings.verdict.causes for other in c.confusable_with}
    figure, axes = canvas(8.0, 1.0 + 0.24 * len(shown))
    place = axes[0, 0]
    y = rows_of(place, [name for name, _ in shown])
    values = np.array([c.log_bayes_factor for _, c in shown])
    colours = [BEFORE if c.name in named else AFTER if c.name in alike else "#c9ced6" for _, c in shown]
    place.barh(y, values, color=colours)
    place.set_xscale("log")
    place.set_xlim(LEAST, max(100.0, 1.5 * values.max()))
    place.xaxis.set_major_formatter("{x:g}")
    if findings.diagnosis is not None:
        place.axvline(findings.diagnosis.search.threshold, lw=1.0, color=QUIET)
    place.set_xlabel("log Bayes factor over none [nats]")
    return png(figure)
