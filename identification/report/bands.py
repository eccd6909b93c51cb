"""Held-out innovations over what they may depend on."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification.gain import Gain
from identification.report.drivers import drivers
from identification.report.means import Course, binned, course

Floats = NDArray[np.float64]


def courses(gain: Gain, channels: Sequence[str]) -> list[Course]:
    """Every channel over every driver, in standard deviations."""
    bench = gain.judged
    judged = [drivers(bench, i) for i in range(len(bench.names))]
    numbers = {about.name: number for number, about in bench.channels.items()}
    found = []
    for name in channels:
        rows = [(item, item.channel == numbers[name]) for item in gain.residuals]
        before, after = ([getattr(item, which)[at] for item, at in rows] for which in ("before", "after"))
        good = [np.isfinite(part) for part in before]
        for driver, about in judged[0].items():
            x = [drive[driver].at(item.t[at]) for (item, at), drive in zip(rows, judged, strict=True)]
            bins = binned(x, [g & np.isfinite(part) for g, part in zip(good, x, strict=True)], about.near)
            if bins is not None:
                std = 1.0 / np.sqrt(bins.count)
                found.append(course(name, "std", driver, about.label, bins, before, after, std))
    return found
