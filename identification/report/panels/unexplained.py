"""What no cause explains: the curves."""

import numpy as np

from identification.report.drawing import AFTER, BAND, BEFORE, canvas, png
from identification.report.findings import Findings

TITLE = "What no cause explains"
CAPTION = (
    "What the channel is off by over what it depends on, with its band (2 sigma); dashed: the closed form, up to a "
    "constant: what the channel is off by everywhere can hardly be told from a bias."
)


def draw(findings: Findings) -> bytes | None:
    """A picture for each effect that was found."""
    shown = [item for item in findings.verdict.unexplained if item.curve is not None]
    if not shown:
        return None
    forms = {(f.way.name, f.driver): f.form for f in findings.diagnosis.unknown} if findings.diagnosis else {}
    figure, axes = canvas(max(4.2 * len(shown), 6.4), 3.8, 1, len(shown))
    for place, item in zip(axes[0], shown, strict=True):
        curve = item.curve
        assert curve is not None
        x, value, std = (np.asarray(part) for part in (curve.x, curve.value, curve.std))
        driver = item.depends_on[0]
        place.fill_between(x, value - 2.0 * std, value + 2.0 * std, color=BAND, zorder=0)
        place.plot(x, value, lw=1.6, color=AFTER)
        form = forms.get((item.channel, driver))
        if form is not None:
            place.plot(x, form(x) + np.mean(value - form(x)), "--", lw=1.2, color=BEFORE, label=form.text)
            place.legend(fontsize=7, frameon=False)
        place.set_title(f"{item.channel}, {item.nats:.0f} nats", loc="left", fontsize=10)
        place.set_xlabel(f"{driver.replace('_', ' ')} [{curve.x_unit}]")
        place.set_ylabel(f"off by [{curve.unit}]")
    return png(figure)
