"""Features of the ring landmark as Wu 2019, section 2, takes them: the outermost ring's contour, the corners of the Ts.

Preparation: median, threshold, opening and closing. Contours of Canny's edges that are circles; the outermost ring is
the circle with the others about the same centre. Harris' corners around it, ordered clockwise about its centre.

All is judged on the pad's plane one unit below the camera, where a ring is a circle whatever the pixels' shape: level
as the paper assumes, or by the attitude.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.ellipse import Circle, fit_circle
from estimators.vision.threshold import above, otsu
from flightlog.marks import RingMark

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]
ToPlane = Callable[[Floats], Floats]  # pixels (N, 2) of the picture given -> (N, 2) right, forward per unit of height

LEAST_POINTS = 40  # of a contour
FEW = 48  # of them for a first look
CANNY = (50.0, 150.0)  # on a binary picture any pair will do
ROUND = 0.035  # RMS distance from a circle over its radius; a tilt of 10 deg makes 0.01
WIDEST_GAP = math.radians(40.0)  # a contour open any wider is no ring
CONCENTRIC = 0.08  # of the radius; seen 10 deg tilted, a smaller ring's centre is off by less
SAME_RATIO = 0.03  # of two radii, off in the mean: edges are a pixel wide, paint a millimetre
HARRIS_BLOCK, HARRIS_APERTURE, HARRIS_K = 3, 3, 0.04
HARRIS_SHARE = 0.1  # of the strongest response
CORNER_REACH = 0.06  # of the ring's diameter: a corner farther from where it should be is another
LEAST_CORNERS = 6
BORDER = 5  # [px]


@dataclass(frozen=True, eq=False)
class RingFeatures:
    """What was found in one picture."""

    contour: Floats  # (N, 2) [px] outer edge of the outermost ring that is wholly in the picture
    circle: Circle  # the same on the pad's plane, per unit of height
    radius: float  # [m] its true radius
    corners: Floats  # (16, 2) [px] of the Ts in the order of `RingMark.t_corners`; NaN where not found
    angle: float  # [rad] of the mark's axis, clockwise from forward, as the corners were matched; NaN without


def prepare(grey: Image) -> Image:
    """The binary picture (H, W), 0 and 255: median, Otsu, opening, closing."""
    smooth = np.asarray(cv2.medianBlur(grey, 3), np.uint8)
    mask = above(smooth, otsu(smooth))
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, cross)
    return np.asarray(cv2.morphologyEx(opened, cv2.MORPH_CLOSE, cross), np.uint8)


def find_ring(binary: Image, to_plane: ToPlane, mark: RingMark) -> tuple[Floats, Circle, float] | None:
    """The outermost ring that is wholly in the picture; None where there is none.

    Returns the contour (N, 2) [px] of its outer edge, the circle through it on the plane and its true radius [m].
    """
    edges = cv2.Canny(binary, *CANNY)
    contours, hierarchy = cv2.findContours(edges, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    circles: list[tuple[Circle, Floats, bool]] = []
    for number, contour in enumerate(contours):
        # a line of edge pixels is a component; its inner side is not traced again
        if len(contour) < LEAST_POINTS or hierarchy[0][number][3] >= 0:
            continue
        _, _, width, height = cv2.boundingRect(contour)
        # an ellipse fills pi/4 of its box if it lies along it, a little less or more if not
        filled = cv2.contourArea(contour) / (0.25 * math.pi * width * height)
        if min(width, height) < 0.5 * max(width, height) or not 0.8 < filled < 1.15:
            continue
        pixels = contour.reshape(-1, 2).astype(float)
        # most contours are no circle, which a few of their points show as well
        if _circle(to_plane(pixels[:: max(1, len(pixels) // FEW)])) is None:
            continue
        circle = _circle(to_plane(pixels))
        if circle is not None:
            circles.append((circle, pixels, _bright_within(binary, pixels)))
    circles.sort(key=lambda found: -found[0].radius)
    for circle, pixels, bright in circles:
        within = [
            (other.radius / circle.radius, other_bright) for other, _, other_bright in circles
            if other is not circle and math.dist(other.centre, circle.centre) < CONCENTRIC * circle.radius
            and other.radius < 0.95 * circle.radius
        ]  # fmt: skip
        if bright and any(not inner for _, inner in within):
            which, off = _which_ring(within, mark)
            if off < SAME_RATIO:
                return pixels, circle, float(_edges(mark)[which])
    return None


def _which_ring(within: list[tuple[float, bool]], mark: RingMark) -> tuple[int, float]:
    """Number of the edge that has such circles within, and by how much their ratios are off, in the mean.

    within: radius over that of the edge, and whether it is bright within, for each.
    """
    radii = _edges(mark)
    # edges are bright within and dark within by turns, the outermost bright
    off = []
    for i in range(0, len(radii), 2):
        expected = {True: radii[i + 2 :: 2] / radii[i], False: radii[i + 1 :: 2] / radii[i]}
        off.append(np.mean([min(abs(ratio - expected[bright]), default=1.0) for ratio, bright in within]))
    best = int(np.argmin(off))
    return 2 * best, float(off[best])


def _edges(mark: RingMark) -> Floats:
    """Radii (N,) [m] of all circular edges, outermost first."""
    outer, middle, inner = mark.rings
    return np.array(
        [outer[1], outer[0], middle[1], middle[0], mark.grid_radius, mark.well_radius, inner[1], inner[0]]
    )


def _bright_within(binary: Image, pixels: Floats) -> bool:
    """Whether a closed contour (N, 2) [px] has white to its inside and black to its outside."""
    middle = 0.5 * (pixels.min(axis=0) + pixels.max(axis=0))
    arms = pixels[:: max(1, len(pixels) // 64)] - middle
    reach = np.maximum(np.linalg.norm(arms, axis=1)[:, None], 1.0)
    limit = np.array(binary.shape[::-1]) - 1
    inner, outer = (
        np.clip(np.rint(middle + arms * (1.0 + side * np.maximum(2.5 / reach, 0.04))), 0, limit).astype(int)
        for side in (-1.0, 1.0)
    )
    return bool(binary[inner[:, 1], inner[:, 0]].mean() > binary[outer[:, 1], outer[:, 0]].mean())


def _circle(plane: Floats) -> Circle | None:
    """The circle of a contour (N, 2) on the plane; None where it is none, or a part of one only."""
    if not np.all(np.isfinite(plane)):
        return None
    circle = fit_circle(plane)
    if circle is None or circle.residual > ROUND * circle.radius:
        return None
    around = np.sort(np.arctan2(*(plane - circle.centre).T))
    gap = max(float(np.max(np.diff(around))), 2.0 * math.pi - float(around[-1] - around[0]))
    return circle if gap < WIDEST_GAP else None


def harris_corners(image: Image) -> Floats:
    """Corners (N, 2) [px] of a picture (H, W): local maxima of Harris' response, equation 2."""
    response = cv2.cornerHarris(image.astype(np.float32), HARRIS_BLOCK, HARRIS_APERTURE, HARRIS_K)
    peak = response == cv2.dilate(response, np.ones((5, 5), np.uint8))
    rows, columns = np.nonzero(peak & (response > HARRIS_SHARE * float(response.max())))
    return np.column_stack([columns, rows]).astype(float)


def order_corners(plane: Floats, circle: Circle, radius: float, mark: RingMark) -> tuple[NDArray[np.intp], float]:
    """Which of the corners (N, 2) on the plane is which of the Ts', and the angle [rad] of the mark's axis.

    circle: of `radius` [m] in truth.
    The answer (16,) goes clockwise about the ring's centre as `RingMark.t_corners` does; -1 and NaN where not found.
    """
    model = mark.t_corners()
    nothing = np.full(len(model), -1, dtype=np.intp), math.nan
    seen = (plane - circle.centre) * (radius / circle.radius)  # [m]
    reach = CORNER_REACH * mark.size
    away, should = np.hypot(*seen.T), np.hypot(*model.T)
    near = np.abs(away[:, None] - should) < reach
    if near.sum() < LEAST_CORNERS:
        return nothing
    # every pairing of a corner seen with one of the same distance from the centre votes for an angle
    clockwise = np.arctan2(seen[:, 0], seen[:, 1])[:, None] - np.arctan2(model[:, 0], model[:, 1])
    votes = np.exp(1j * clockwise[near])
    trial = np.exp(1j * np.arange(0.0, 2.0 * math.pi, math.radians(1.5)))
    agree = np.abs(np.angle(votes * np.conj(trial[:, None]))) < math.radians(3.0)
    best = int(np.argmax(agree.sum(axis=1)))
    angle = float(np.angle(votes[agree[best]].sum()))
    c, s = math.cos(angle), math.sin(angle)
    placed = model @ np.array([[c, -s], [s, c]])
    distance = np.linalg.norm(placed[:, None] - seen, axis=2)
    chosen = np.argmin(distance, axis=1)
    taken = distance[np.arange(len(model)), chosen] < 0.75 * reach
    # of two that claim the same corner neither is sure
    taken &= np.bincount(chosen[taken], minlength=len(seen))[chosen] == 1
    if taken.sum() < LEAST_CORNERS:
        return nothing
    return np.where(taken, chosen, -1), angle


def find_features(grey: Image, corner: tuple[int, int], to_plane: ToPlane, mark: RingMark) -> RingFeatures | None:
    """Ring and corners in a part of a picture, its upper left pixel at `corner` (x, y) of the whole; None without ring.

    to_plane takes pixels of the whole picture.
    """
    binary = prepare(grey)
    shift = np.array(corner, float)
    ring = find_ring(binary, lambda pixels: to_plane(pixels + shift), mark)
    if ring is None:
        return None
    contour, circle, radius = ring
    corners = np.full((len(mark.t_corners()), 2), np.nan)
    angle = math.nan
    # the Ts' farthest corner over the ring's radius; a square box holds it whatever the heading
    reach = 1.15 * float(np.hypot(*mark.t_corners().T).max()) / radius
    middle, half = contour.mean(axis=0), 0.5 * np.ptp(contour, axis=0) * reach + 4.0
    x0, y0 = np.maximum(np.floor(middle - half), 0).astype(int)
    x1, y1 = np.ceil(middle + half).astype(int) + 1
    found = harris_corners(binary[y0:y1, x0:x1]) + [x0, y0]
    # where a bar leaves the picture it has corners that are none
    inside = (found >= BORDER) & (found <= np.array(binary.shape[::-1]) - 1 - BORDER)
    found = found[inside.all(axis=1)] + shift
    if len(found):
        plane = to_plane(found)
        sound = np.all(np.isfinite(plane), axis=1)
        which, angle = order_corners(plane[sound], circle, radius, mark)
        corners[which >= 0] = found[sound][which[which >= 0]]
    return RingFeatures(contour + shift, circle, radius, corners, angle)
