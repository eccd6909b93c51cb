"""Means of residuals over what they may depend on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.gain import Gain
from identification.report.drivers import drivers

Floats = NDArray[np.float64]

BINS = 12
LEAST = 20  # rows in a bin
SIGMAS = 3.0  # of a null band


@dataclass(frozen=True, eq=False)
class Course:
    """One channel's held-out residuals over one driver, in standard deviations."""

    channel: str
    driver: str
    label: str
    middles: Floats  # (B,)
    before: Floats  # (B,) means
    after: Floats  # (B,)
    band: Floats  # (B,) within which a mean lies where nothing is wrong

    @property
    def excess(self) -> float:
        """[nats] by which the means before lie beyond chance."""
        return float(0.5 * np.sum((SIGMAS * self.before / self.band) ** 2 - 1.0))

    @property
    def taken(self) -> float:
        """[nats] that the causes take out of the means."""
        return float(0.5 * np.sum((SIGMAS / self.band) ** 2 * (self.before**2 - self.after**2)))


def courses(gain: Gain, channels: Sequence[str]) -> list[Course]:
    """Every channel over every driver."""
    bench = gain.judged
    judged = [drivers(bench, i) for i in range(len(bench.names))]
    numbers = {about.name: number for number, about in bench.channels.items()}
    found = []
    for name in channels:
        parts = [(item, item.channel == numbers[name]) for item in gain.residuals]
        before, after = (
            np.concatenate([getattr(item, which)[at] for item, at in parts]) for which in ("before", "after")
        )
        for driver in judged[0]:
            values = np.concatenate(
                [drive[driver].at(item.t[at]) for (item, at), drive in zip(parts, judged, strict=True)]
            )
            course = _course(name, driver, judged[0][driver].label, values, before, after)
            if course is not None:
                found.append(course)
    return found


def _course(name: str, driver: str, label: str, values: Floats, before: Floats, after: Floats) -> Course | None:
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1))) if len(values) else np.zeros(0)
    if len(edges) < 3:
        return None
    which = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    count = np.bincount(which, minlength=len(edges) - 1)
    kept = count >= LEAST
    if not kept.any():
        return None
    total = np.maximum(count, 1)
    means = [np.bincount(which, v, len(edges) - 1) / total for v in (before, after)]
    middles = np.bincount(which, values, len(edges) - 1) / total
    return Course(name, driver, label, middles[kept], means[0][kept], means[1][kept], SIGMAS / np.sqrt(count[kept]))
