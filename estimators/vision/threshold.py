"""Thresholds from a grey histogram: Lei 2012's modified Otsu (section 2.2.1, step 1) and plain Otsu."""

from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


def histogram(grey: Image) -> NDArray[np.float64]:
    """Counts (256,) of the grey levels of a picture (H, W)."""
    return cv2.calcHist([grey], [0], None, [256], [0, 256]).ravel().astype(float)


def modified_otsu(grey: Image, variant: Literal["printed", "open"] = "open") -> int | None:
    """Threshold [grey level] for a target brighter than the mean; the target is grey > T. None: no two classes.

    T0 is the mean of the picture (H, W), T1 the mean of all pixels above T0; T in (T0, T1) maximises
    w0 w1 (u0 - u1)^2, shares w taken of the whole picture, of the classes (T0, T] and, `printed`, (T, T1] or,
    `open`, everything above T. The printed form ignores the pixels above T1, so that a small target in a noisy
    picture is lost; both want a region in which the target is not a small part.
    """
    counts = histogram(grey)
    levels = np.arange(256.0)
    total = counts.sum()
    t0 = float(counts @ levels / total)
    above = levels > t0
    if not counts[above].any():
        return None
    t1 = float((counts * levels)[above].sum() / counts[above].sum())
    upper = above & (levels <= t1) if variant == "printed" else above
    kept = np.where(upper, counts, 0.0)
    number, moment = np.cumsum(kept), np.cumsum(kept * levels)
    candidates = np.flatnonzero((levels > t0) & (levels < t1))
    n0, m0 = number[candidates], moment[candidates]
    n1, m1 = number[-1] - n0, moment[-1] - m0
    both = (n0 > 0) & (n1 > 0)
    if not both.any():
        return None
    n0, m0, n1, m1 = n0[both], m0[both], n1[both], m1[both]
    between = n0 * n1 / total**2 * (m0 / n0 - m1 / n1) ** 2
    return int(candidates[both][np.argmax(between)])


def otsu(grey: Image) -> int:
    """Otsu's threshold [grey level] of a picture (H, W); classes are grey <= T and grey > T."""
    level, _ = cv2.threshold(grey, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    return int(level)


def lower_otsu(grey: Image, level: int) -> int | None:
    """Otsu's threshold among the pixels up to `level`: parts a shadowed mark from a dark pad. None: nothing to part."""
    lower = grey[grey <= level]
    if lower.size < 2 or lower.min() == lower.max():
        return None
    return otsu(lower.reshape(1, -1))


def class_contrast(grey: Image, level: int) -> float:
    """Difference [grey levels] between the means above a threshold and up to it; 0 where a class is empty."""
    counts = histogram(grey)
    levels = np.arange(256.0)
    low, high = counts[: level + 1], counts[level + 1 :]
    if not low.any() or not high.any():
        return 0.0
    return float(high @ levels[level + 1 :] / high.sum() - low @ levels[: level + 1] / low.sum())


def above(grey: Image, level: int, *, below: bool = False) -> Image:
    """Mask (H, W), 255 where grey > level; with `below` where it is not."""
    kind = cv2.THRESH_BINARY_INV if below else cv2.THRESH_BINARY
    return np.asarray(cv2.threshold(grey, level, 255, kind)[1], np.uint8)


def local_mask(grey: Image, window: int, margin: float) -> Image:
    """Mask (H, W), 255 where a pixel is `margin` [grey levels] above the mean of its window [px]: uneven light."""
    mean = cv2.blur(grey, (window, window), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.compare(grey, cv2.add(mean, np.full(1, margin)), cv2.CMP_GT), np.uint8)
