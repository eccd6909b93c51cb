"""Where in a picture an H of unknown proportions may lie: outlines of its level sets, through all grey levels.

No single threshold suits a blurred, unevenly lit picture; the H stands out at some levels at least. What is kept looks,
stretched to a square, like an H of some stroke.
"""

import math
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

STEP = 7.0  # [grey levels] between level sets
SMALLEST = 9.0  # [px] shorter side
SLIMMEST = 0.42  # shorter side over longer; an H has 0.6, a smeared one less
SOLIDITY = (0.25, 0.93)  # area over area of the hull
FEWEST = 30  # [px] of a mark
GRID = 12  # cells a side of the stretched shape
LEAST_ALIKE = 0.5  # overlap with an H, intersection over union
SAME = 0.75  # overlap of boxes that show the same thing
MOST, MOST_CUT = 14, 8  # shapes worth a closer look
LEAST_ANGULAR = 0.75


@dataclass(frozen=True, eq=False)
class Blob:
    """The outline of a level set, and the H that it resembles."""

    contour: NDArray[np.int32]  # (N, 1, 2) [px]
    polarity: int  # +1 light, -1 dark
    cut: bool  # touches the picture's border
    alike: float  # [0..1] overlap with the H; where it is cut, share of the outline that goes along two directions
    centre: Floats  # (2,) [px]
    legs: Floats  # (2,) [px] from end to end of a leg, along the H's axis; without meaning where it is cut
    across: Floats  # (2,) [px] over the H's width
    stroke: float  # over the leg's length
    level: float  # [grey level]


def blobs(grey: Image) -> list[Blob]:
    """Level sets of a picture (H, W) that may be an H, likeliest first; then those that the picture's edge cuts."""
    found: list[Blob] = []
    counts = np.cumsum(np.bincount(grey.ravel(), minlength=256))
    # a level beyond which next to nothing lies shows no mark
    low, high = (float(v) for v in np.searchsorted(counts, (FEWEST, grey.size - FEWEST)))
    for level in np.arange(low + STEP / 2, max(high, low + STEP), STEP):
        for polarity in (1, -1):
            kind = cv2.THRESH_BINARY if polarity > 0 else cv2.THRESH_BINARY_INV
            mask = np.asarray(cv2.threshold(grey, level, 255, kind)[1], np.uint8)
            contours, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
            if len(contours) == 0:
                continue
            family = hierarchy.reshape(-1, 4)
            for i, contour in enumerate(contours):
                # an H is one piece without holes, but for a speck or two
                if family[i, 3] >= 0 or len(contour) < 3.0 * SMALLEST:
                    continue
                blob = _blob(np.asarray(contour, np.int32), polarity, float(level), grey.shape)
                if blob is not None:
                    found.append(blob)
    found.sort(key=lambda blob: -blob.alike)
    whole, cut = [b for b in found if not b.cut], [b for b in found if b.cut]
    return _distinct(whole, MOST) + _distinct(cut, MOST_CUT)


def _blob(contour: NDArray[np.int32], polarity: int, level: float, shape: tuple[int, ...]) -> Blob | None:
    """A contour as a blob, where it may be an H."""
    x, y, w, h = cv2.boundingRect(contour)
    if min(w, h) < SMALLEST:
        return None
    cut = x <= 0 or y <= 0 or x + w >= shape[1] or y + h >= shape[0]
    hull = cv2.convexHull(contour)
    # outlines run through pixel centres: half a pixel more all around
    length, hull_length = cv2.arcLength(contour, True), cv2.arcLength(hull, True)
    area = cv2.contourArea(contour) + 0.5 * length + 1.0
    hull_area = cv2.contourArea(hull) + 0.5 * hull_length + 1.0
    if not SOLIDITY[0] <= area / hull_area <= SOLIDITY[1]:
        return None
    # an H's outline is at most some 2.4 times as long as that of its hull; foliage is longer
    if length > 3.2 * hull_length:
        return None
    centre, (one, other), angle = cv2.minAreaRect(contour)
    sides = np.array([one + 1.0, other + 1.0])
    if sides.min() < SMALLEST or sides.min() < SLIMMEST * sides.max():
        return None
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    first, second = np.array([c, s]) * sides[0], np.array([-s, c]) * sides[1]
    if cut:
        alike = _angular(contour, shape)
        if alike < LEAST_ANGULAR:
            return None
        return Blob(contour, polarity, True, alike, np.asarray(centre, float), first, second, 0.2, level)
    best, stroke, lengthwise = _best_h(_stretched(contour, np.asarray(centre), first, second))
    if best < LEAST_ALIKE:
        return None
    legs, across = (second, first) if lengthwise else (first, second)
    if not lengthwise:
        across = -across
    return Blob(contour, polarity, False, best, np.asarray(centre, float), legs, across, stroke, level)


def _angular(contour: NDArray[np.int32], shape: tuple[int, ...]) -> float:
    """Share of the outline within the picture that goes along two directions at right angles; 0 for foliage."""
    perimeter = cv2.arcLength(contour, True)
    corners = cv2.approxPolyDP(contour, float(np.clip(0.008 * perimeter, 1.5, 10.0)), True).reshape(-1, 2).astype(float)
    if not 5 <= len(corners) <= 24:
        return 0.0
    size = np.array([shape[1], shape[0]]) - 1.0
    following = np.roll(corners, -1, axis=0)
    sides = following - corners
    on_border = ((corners < 2) & (following < 2) | (corners > size - 2) & (following > size - 2)).any(axis=1)
    lengths = np.where(on_border, 0.0, np.hypot(*sides.T))
    directions = np.arctan2(sides[:, 1], sides[:, 0])
    main = np.angle((lengths * np.exp(4j * directions)).sum())
    aligned = np.cos(4 * directions - main) > 0.7
    return float(lengths[aligned].sum() / max(lengths.sum(), 1e-9))


def _stretched(contour: NDArray[np.int32], centre: Floats, first: Floats, second: Floats) -> Image:
    """The filled contour (4 GRID, 4 GRID), its rectangle stretched to a square: first along x, second along y."""
    size = 4 * GRID
    inverse = np.linalg.inv(np.column_stack([first, second]))
    flat = ((contour.reshape(-1, 2) - centre) @ inverse.T + 0.5) * size
    square = np.zeros((size, size), np.uint8)
    cv2.fillPoly(square, [np.rint(flat * 16 - 8).astype(np.int32)], 1, cv2.LINE_8, 4)
    return square


@cache
def _templates() -> tuple[Floats, Floats]:
    """Stretched H's (M, 16 GRID^2) with legs along y, and the stroke over the leg of each (M,)."""
    size = 4 * GRID
    at = np.abs((np.arange(size) + 0.5) / size - 0.5)
    shapes, strokes = [], []
    for stroke in (0.12, 0.18, 0.24, 0.3):
        for width in (0.65, 0.9, 1.2):
            legs = at > 0.5 - min(stroke / width, 0.42)
            shapes.append((legs[None, :] | (at < stroke / 2)[:, None]).ravel())
            strokes.append(stroke)
    return np.array(shapes, float), np.array(strokes)


def _best_h(square: Image) -> tuple[float, float, bool]:
    """Overlap with the most similar H, its stroke over the leg, and whether its legs run along y."""
    shapes, strokes = _templates()
    areas = shapes.sum(axis=1)
    best = (0.0, 0.2, True)
    for lengthwise, flat in ((True, square.ravel()), (False, square.T.ravel())):
        both = shapes @ flat.astype(float)
        overlap = both / (areas + float(flat.sum()) - both)
        i = int(np.argmax(overlap))
        if overlap[i] > best[0]:
            best = (float(overlap[i]), float(strokes[i]), lengthwise)
    return best


def _distinct(found: list[Blob], most: int) -> list[Blob]:
    """The best of those that show the same thing."""
    kept: list[Blob] = []
    boxes: list[Floats] = []
    for blob in found:
        x, y, w, h = cv2.boundingRect(blob.contour)
        box = np.array([x, y, x + w, y + h], float)
        for other, rival in zip(boxes, kept, strict=True):
            overlap = np.clip(np.minimum(box[2:], other[2:]) - np.maximum(box[:2], other[:2]), 0, None).prod()
            union = (box[2:] - box[:2]).prod() + (other[2:] - other[:2]).prod() - overlap
            if overlap > SAME * union and rival.polarity == blob.polarity:
                break
        else:
            kept.append(blob)
            boxes.append(box)
        if len(kept) >= most:
            break
    return kept
