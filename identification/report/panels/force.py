"""The force, moment or power that the model lacks, in physical units."""

from identification.report.drawing import AFTER, BAND, BEFORE, canvas, png
from identification.report.findings import Findings
from identification.report.unforeseen import Curve, curves

TITLE = "What the model lacks"
CAPTION = (
    "Measured less what the model says along the measured motion (inverse dynamics), means over all flights. "
    "Grey-blue: scatter by gusts and noise (2 sigma)."
)
SHOWN = 3


def draw(findings: Findings) -> bytes | None:
    """The curves from which the causes take most, each channel once."""
    if findings.diagnosis is None or not any(c.where != "sensor" for c in findings.verdict.causes):
        return None
    search = findings.diagnosis.search
    chosen: dict[str, Curve] = {}
    for curve in curves(findings.diagnosis.bench, search.null, search.fit(findings.diagnosis.causes)):
        if curve.taken > 0.0:
            chosen.setdefault(curve.channel, curve)
    if not chosen:
        return None
    shown = list(chosen.values())[:SHOWN]
    figure, axes = canvas(4.2 * len(shown), 3.6, 1, len(shown))
    for place, curve in zip(axes[0], shown, strict=True):
        place.fill_between(curve.middles, -curve.band, curve.band, color=BAND, label="gusts and noise", zorder=0)
        place.plot(curve.middles, curve.before, "o-", ms=3, lw=1.2, color=BEFORE, label="model as it was")
        place.plot(curve.middles, curve.after, "o-", ms=3, lw=1.2, color=AFTER, label="extended")
        place.set_title(curve.channel, loc="left", fontsize=10)
        place.set_xlabel(curve.label)
        place.set_ylabel(f"measured less model [{curve.unit}]")
    axes[0, 0].legend(fontsize=8, frameon=False)
    return png(figure)
