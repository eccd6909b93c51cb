"""Where no verdict is possible: which channel the model cannot follow, and when."""

import numpy as np
from numpy.typing import NDArray

from identification.left_over import left_over
from identification.report.drawing import AFTER, BAND, BEFORE, canvas, png, rows_of
from identification.report.findings import Findings
from identification.stack import Rows

TITLE = "What does not fit"
CAPTION = (
    "Innovations in their expected deviations, all that may be off anyway fitted, no cause in force. Left: root mean "
    "square of each channel over all flights, where nothing is wrong at most about 1 (line). Right: the worst channel "
    "(red) over time, on the flight on which it fits least; band: 2 deviations."
)

Floats = NDArray[np.float64]


def draw(findings: Findings) -> bytes | None:
    """Every channel, and the worst of them over time."""
    diagnosis = findings.diagnosis
    if diagnosis is None or findings.verdict.baseline.certified:
        return None
    bench = diagnosis.bench
    flights = left_over(bench, diagnosis.search.null)
    size = {
        channel.name: _size(np.concatenate([_of(rows, left, number)[1] for rows, left in flights]))
        for number, channel in bench.channels.items()
        if any((rows.channel == number).any() for rows, _ in flights)
    }
    worst = max(size, key=lambda name: size[name])
    number = next(number for number, channel in bench.channels.items() if channel.name == worst)
    shown = max(range(len(flights)), key=lambda i: _size(_of(*flights[i], number)[1]))
    t, left = _of(*flights[shown], number)
    figure, axes = canvas(10.0, 1.2 + 0.2 * len(size), 1, 2, width_ratios=(2, 3))
    bars, place = axes[0]
    colours = [BEFORE if name == worst else AFTER for name in size]
    bars.barh(rows_of(bars, list(size)), list(size.values()), color=colours)
    bars.axvline(1.0, lw=1.0, color="#9db4c8")
    bars.set_xlabel("root mean square [std]")
    place.axhspan(-2.0, 2.0, color=BAND, zorder=0)
    place.plot(t - t[0], left, ".", ms=3, color=BEFORE)
    place.set_title(f"{worst}, {bench.names[shown]}", loc="left", fontsize=10)
    place.set_xlabel("time [s]")
    place.set_ylabel("innovation [std]")
    return png(figure)


def _of(rows: Rows, left: Floats, channel: int) -> tuple[Floats, Floats]:
    """Times and innovations (M,) of one channel, those that count."""
    at = (rows.channel == channel) & (rows.residual != 0.0)
    return rows.t[at], left[at]


def _size(left: Floats) -> float:
    return float(np.sqrt(np.mean(left**2))) if len(left) else 0.0
