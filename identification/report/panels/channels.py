"""How large the innovations of every channel are."""

import numpy as np

from identification.report.drawing import AFTER, BAND, BEFORE, QUIET, canvas, png, rows_of
from identification.report.findings import Findings

TITLE = "Size of the innovations, channel by channel"
CAPTION = (
    "Root mean square over held-out rows, over the floor: all that has a name fitted to these very rows, what a fit "
    "follows by chance given back. 1: nothing is left to explain. Crosses at the edge lie further out."
)


def draw(findings: Findings) -> bytes | None:
    """A bar for each channel before, a mark after."""
    if findings.gain is None or not findings.gain.channels:
        return None
    channels = findings.gain.channels
    figure, axes = canvas(8.0, 0.9 + 0.24 * len(channels))
    place = axes[0, 0]
    y = rows_of(place, [c.channel for c in channels])
    floor = np.array([max(c.floor, 1e-300) for c in channels])
    band = 3.0 / np.sqrt(2.0 * np.array([c.rows for c in channels]))
    place.barh(y, 2 * band, left=1.0 - band, height=0.9, color=BAND, label="chance, 3 sigma")
    marks = [("model as it was", "o", BEFORE, [c.before for c in channels])]
    if findings.verdict.causes:
        marks.append(("extended", "D", AFTER, [c.after for c in channels]))
        marks.append(("all parameters fitted", "x", QUIET, [c.everything for c in channels]))
    reach = 1.5 * float(band.max())
    own = np.concatenate([*(np.array(values) / floor for *_, values in marks[:2]), [1.0 - reach, 1.0 + reach]])
    low, high = own.min() - 0.03 * np.ptp(own), own.max() + 0.03 * np.ptp(own)
    for label, shape, colour, values in marks:
        shown = np.clip(np.array(values) / floor, low, high)
        place.plot(shown, y, shape, ms=4, color=colour, label=label, clip_on=False)
    place.set_xlim(low, high)
    place.axvline(1.0, lw=0.8, color=QUIET)
    place.set_xlabel("rms over floor")
    place.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return png(figure)
