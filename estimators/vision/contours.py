"""Contours of a binary picture that may be a given flat mark, before any pose is known (Lei 2012, section 2.2.1)."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.moments import affine_invariants, central_moments, mismatch

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class ShapeTemplate:
    """What a mark's shape is known by under any affine map."""

    invariants: Floats  # (5,) I1, I2, I3, I6, I7
    solidity: float  # area over area of its convex hull

    @classmethod
    def of(cls, outline: Floats, resolution: float = 400.0) -> "ShapeTemplate":
        """The template of an outline (N, 2), rasterised with its larger side `resolution` pixels long."""
        low, high = outline.min(axis=0), outline.max(axis=0)
        scale = resolution / (high - low).max()
        shift = 4
        corners = np.rint(((outline - low) * scale + 2.0) * 2**shift).astype(np.int32)
        mask = np.zeros(np.ceil((high - low)[::-1] * scale + 5).astype(int), np.uint8)
        cv2.fillPoly(mask, [corners], 255, cv2.LINE_8, shift)
        flat = outline.astype(np.float32)
        solidity = cv2.contourArea(flat) / cv2.contourArea(cv2.convexHull(flat))
        return cls(affine_invariants(central_moments(mask)), float(solidity))


@dataclass(frozen=True, eq=False)
class Candidate:
    """One contour that passed the preliminary rejection."""

    contour: NDArray[np.int32]  # (N, 1, 2) [px] through the centres of the outermost pixels
    box: tuple[int, int, int, int]  # left, top, right, bottom [px], right and bottom excluded
    area: float  # [px^2] of the mask with its holes filled
    mismatch: float  # equation 4 against the template

    def enlarged(self, times: int) -> "Candidate":
        """The same in a picture that is larger by a whole factor; its contour to half a pixel of this one."""
        if times == 1:
            return self
        contour = np.asarray(np.rint((self.contour + 0.5) * times - 0.5), np.int32)
        x0, y0, x1, y1 = self.box
        box = (x0 * times, y0 * times, x1 * times, y1 * times)
        return Candidate(contour, box, self.area * times**2, self.mismatch)


@dataclass(frozen=True, eq=False)
class Traced:
    """The contours of a binary picture, of its light parts and of their holes."""

    mask: Image  # (H, W)
    contours: Sequence[NDArray[np.int32]]  # (N, 1, 2) each
    outer: NDArray[np.bool_]  # whether round a light part

    @classmethod
    def of(cls, mask: Image) -> "Traced":
        """Contours of a binary picture (H, W)."""
        contours, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        outer = hierarchy.reshape(-1, 4)[:, 3] < 0 if len(contours) else np.zeros(0, bool)
        return cls(mask, [np.asarray(contour, np.int32) for contour in contours], outer)


def fill(contour: NDArray[np.int32], box: tuple[int, int, int, int]) -> tuple[Image, float, float]:
    """A contour (N, 1, 2) filled within its box (x, y, width, height), its area and that of its hull [px^2]."""
    x, y, w, h = box
    filled = np.zeros((h, w), np.uint8)
    cv2.drawContours(filled, [contour], -1, 255, cv2.FILLED, offset=(-x, -y))
    hull = cv2.convexHull(contour)
    # the hull runs through pixel centres: half a pixel more all around
    hull_area = cv2.contourArea(hull) + 0.5 * cv2.arcLength(hull, True) + 1.0
    return filled, float(cv2.countNonZero(filled)), float(hull_area)


def candidates(
    traced: Traced,
    template: ShapeTemplate,
    *,
    area: tuple[float, float],
    worst: float,
    solidity_margin: float,
    longest_side_ratio: float = 2.2,
) -> list[Candidate]:
    """Contours of a mask that match the template, best first.

    area: least and largest [px^2]; worst: largest value of equation 4. Contours that touch the mask's border are left
    out: they may be cut.
    """
    # an outline of area A is at least as long as that of a disc
    shortest = 2.0 * np.sqrt(np.pi * area[0]) * 0.8
    height, width = traced.mask.shape
    found = []
    for contour, is_outer in zip(traced.contours, traced.outer, strict=True):
        if not is_outer or len(contour) < shortest:
            continue
        x, y, w, h = cv2.boundingRect(contour)
        if x <= 0 or y <= 0 or x + w >= width or y + h >= height:
            continue
        if not area[0] * 0.5 <= cv2.contourArea(contour) <= area[1]:
            continue
        filled, pixels, hull_area = fill(contour, (x, y, w, h))
        if not area[0] <= pixels <= area[1] or abs(pixels / hull_area - template.solidity) > solidity_margin:
            continue
        sides = sorted(cv2.minAreaRect(contour)[1])
        if sides[1] > longest_side_ratio * max(sides[0], 1.0):
            continue
        value = mismatch(affine_invariants(central_moments(filled)), template.invariants)
        if value <= worst:
            found.append(Candidate(contour, (x, y, x + w, y + h), pixels, value))
    return sorted(found, key=lambda candidate: candidate.mismatch)
