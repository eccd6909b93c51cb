"""Whether what is missing of a mark is covered, or was never there."""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LINES = 48  # directions of a cover's edge that are tried
SEEN_EXPECTED, SEEN_ANEW = 0.88, 0.95  # of the edge points on the free side that must agree, in a followed, found mark
COVERED_SHARE = 0.2  # of those on the covered side that may agree by chance
FREE_EXPECTED, FREE_ANEW = 0.5, 0.72  # of all edge points; a T is an H whose other leg is hidden, and has 0.6


def covered_from_one_side(places: Floats, agree: NDArray[np.bool_], *, anew: bool) -> bool:
    """Whether some line parts edge points (N, 2), mark axes, that agree from such that do not.

    A cover hides one side of a mark; another shape disagrees here and there. anew: the mark was not expected there,
    which asks for more.
    """
    if len(places) == 0:
        return False
    seen, least = (SEEN_ANEW, FREE_ANEW) if anew else (SEEN_EXPECTED, FREE_EXPECTED)
    angles = np.arange(LINES) * (2.0 * math.pi / LINES)
    along = places @ np.stack([np.cos(angles), np.sin(angles)])
    order = np.argsort(along, axis=0)
    hits = np.cumsum(agree[order], axis=0)
    free = np.arange(1, len(places) + 1)[:, None]
    beyond = len(places) - free
    covered = (hits[-1] - hits) <= COVERED_SHARE * beyond
    good = (hits >= seen * free) & covered & (free >= least * len(places))
    return bool(good.any())
