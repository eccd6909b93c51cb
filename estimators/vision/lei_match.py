"""Contours of a binary picture and what letter they are: section 2.2.2 of Lei 2012.

Contours by Canny, a first judgement of their size and shape, affine moment invariants, and equation 4 against the
template. The paper matches against its H alone; here other shapes stand by, and a contour that is more like one of
them is not taken, however small its value.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.contours import ShapeTemplate, fill
from estimators.vision.moments import affine_invariants, central_moments, mismatch

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

Edges = Literal["canny", "border"]
Invariants = Literal["printed", "corrected", "extended"]

CANNY = (50.0, 150.0)  # thresholds on a picture of 0 and 255, where any do
SOLIDITY_MARGIN = 0.25  # a square has 1, an H of the usual strokes 0.52
LONGEST = 2.2  # longer to shorter side of the smallest rectangle around
RAGGED = 1.4  # perimeter over that of an H of the same area; blobs of noise have 1.6 to 3
TOUCHES = 1  # [px] from the border a contour may be cut


def _box(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float]]:
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


@cache
def others() -> dict[str, ShapeTemplate]:
    """Templates of what is not an H: square, disc, plus, T, I. A window is a square once its contour is filled.

    An I with bars is an H on its side: but for its proportions, which a little blur changes, an affine map makes one of
    the other.
    """
    turn = np.linspace(0.0, 2.0 * math.pi, 120, endpoint=False)
    shapes = {
        "square": np.array(_box(0, 0, 1, 1), float),
        "disc": np.column_stack([np.cos(turn), np.sin(turn)]),
        "plus": np.array(
            [(0.4, 0), (0.6, 0), (0.6, 0.4), (1, 0.4), (1, 0.6), (0.6, 0.6), (0.6, 1), (0.4, 1), (0.4, 0.6), (0, 0.6),
             (0, 0.4), (0.4, 0.4)]
        ),
        "T": np.array([(0.4, 0), (0.6, 0), (0.6, 0.8), (1, 0.8), (1, 1), (0, 1), (0, 0.8), (0.4, 0.8)]),
        "I": np.array(_box(0, 0, 0.3, 1), float),
    }  # fmt: skip
    return {name: ShapeTemplate.of(outline) for name, outline in shapes.items()}


@dataclass(frozen=True, eq=False)
class Match:
    """A contour that is the mark's."""

    contour: NDArray[np.int32]  # (N, 2) [px]
    value: float  # equation 4
    area: float  # [px^2] inside the contour, its own pixels included


def value(seen: Floats, template: Floats, invariants: Invariants) -> float:
    """Equation 4 of invariants (5,) I1, I2, I3, I6, I7: over I1 to I3, or all of them.

    "printed" sums sgn(I) lg|I| as it stands: for an H, whose I2 and I3 vanish, rounding noise.
    """
    if invariants == "extended":
        return mismatch(seen, template)
    if invariants == "corrected":
        keep = np.array([1.0, 1.0, 1.0, 0.0, 0.0])
        return mismatch(seen * keep, template * keep)
    a, b = seen[:3], template[:3]
    least = np.finfo(float).tiny
    logs = [np.sign(i) * np.log10(np.maximum(np.abs(i), least)) for i in (a, b)]
    return float(np.abs(logs[0] - logs[1]).sum())


def contours(mask: Image, edges: Edges) -> list[NDArray[np.int32]]:
    """Closed contours (N, 1, 2) [px] of a mask (H, W): of Canny's edges as published, or the mask's own borders."""
    drawn = np.asarray(cv2.Canny(mask, *CANNY, L2gradient=True), np.uint8) if edges == "canny" else mask
    found, _ = cv2.findContours(drawn, cv2.RETR_EXTERNAL if edges == "canny" else cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    return [np.asarray(contour, np.int32) for contour in found]


def match(
    mask: Image,
    template: ShapeTemplate,
    *,
    raggedness: float,
    area: tuple[float, float],
    worst: float,
    edges: Edges = "canny",
    invariants: Invariants = "extended",
) -> Match | None:
    """The contour of a mask (H, W) that matches best, if any does by `worst` and is most like the template.

    raggedness: perimeter over root of area of the mark's outline; area: least and largest [px^2] inside the contour.
    Contours at the mask's border are left out: they may be cut.
    """
    height, width = mask.shape
    best: Match | None = None
    for contour in contours(mask, edges):
        if cv2.contourArea(contour) < 0.5 * area[0]:
            continue
        x, y, w, h = cv2.boundingRect(contour)
        if x < TOUCHES or y < TOUCHES or x + w > width - TOUCHES or y + h > height - TOUCHES:
            continue
        filled, pixels, hull_area = fill(contour, (x, y, w, h))
        sides = sorted(cv2.minAreaRect(contour)[1])
        if (
            not area[0] <= pixels <= area[1]
            or abs(pixels / hull_area - template.solidity) > SOLIDITY_MARGIN
            or sides[1] > LONGEST * max(sides[0], 1.0)
            or cv2.arcLength(contour, True) > RAGGED * raggedness * math.sqrt(pixels)
        ):
            continue
        seen = affine_invariants(central_moments(filled))
        likeness = value(seen, template.invariants, invariants)
        if likeness > worst or (best is not None and likeness >= best.value):
            continue
        if any(value(seen, other.invariants, invariants) < likeness for other in others().values()):
            continue
        best = Match(contour.reshape(-1, 2), likeness, pixels)
    return best
