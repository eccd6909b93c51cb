"""How much white noise each sensor has on a flight, by the innovations of the filter of the motion."""

import math

import numpy as np
from numpy.typing import NDArray

from identification import kinematics as k

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_SAMPLES = 40  # to take a noise level from
LEAST_FACTOR = 0.4  # of what it was taken for so far
MOST_ALIKE = 0.98  # correlation of neighbouring innovations
CHI2_MEDIAN = 0.4549  # median of chi-square with one degree of freedom


def noise_factors(
    kinds: Ints, counts: NDArray[np.bool_], stds: Floats, answers: Floats, declared: Floats
) -> Floats:
    """(KINDS,) by which each kind's white noise is larger than taken so far; by medians: outliers do not count.

    counts (M,): what is looked at; what stands on the ground is no measure, a range that is told in steps is always the
    same there.

    Less than declared is believed only where it is white: a sensor that gives running means is quiet from sample to
    sample and no better over a second. White noise of the same density at low frequency is sqrt((1 + c) / (1 - c))
    times as large, where c is the correlation of neighbours (first-order memory); it is taken from that of their
    differences, (c - 1) / 2, to which what varies slowly for other reasons adds nothing.
    """
    factors = np.ones(k.KINDS)
    for kind in range(k.KINDS):
        at = (kinds == kind) & counts & (answers[:, 2] > 0)
        if np.count_nonzero(at) < LEAST_SAMPLES:
            continue
        nu, s, r = answers[at, 0], answers[at, 1], stds[at]
        spread = np.median((nu / s) ** 2) / CHI2_MEDIAN  # of the innovation over what was expected
        share = np.median((r / s) ** 2)  # of the innovation's variance that is white noise
        least = 1.0 if kind >= k.PAD else LEAST_FACTOR  # a mark's floors are no noise
        factors[kind] = math.sqrt(np.clip((spread - (1.0 - share)) / share, least**2, 9.0))
        most = float(np.median(declared[at] / r))
        if factors[kind] < most:
            steps = np.diff(nu / s)
            alike = float(np.clip(1.0 + 2.0 * np.corrcoef(steps[:-1], steps[1:])[0, 1], 0.0, MOST_ALIKE))
            factors[kind] = min(most, factors[kind] * math.sqrt((1.0 + alike) / (1.0 - alike)))
    return factors
