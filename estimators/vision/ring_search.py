"""Where a ring mark may be in a picture, with no pose known: circles on the level plane that share their centre.

Contours of a thresholded picture are carried to the level plane below the camera, where a ring is a circle again (in
the picture it is an ellipse, whose centre is not the ring's). Circles about one centre whose radii are in the mark's
proportions, light and dark as the mark's, give centre and height; the bars around them give the angle.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.pose import LevelAxes, MarkPose, from_pad_plane, on_pad_plane, place
from estimators.vision.search import masks
from flightlog.camera import CameraModel
from flightlog.marks import RingMark

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

SHORTEST = 36  # [px] contour points; a smaller circle tells too little
LEAST_ARC = 0.3  # of a whole turn that must be in the picture
ROUND = 0.7  # 4 pi area / points^2; a circle's contour has 0.9 of its length in points
RAGGED = 0.03  # [radii] RMS of a contour about its circle, beside a pixel
TOGETHER = 0.08  # [radii] between centres of circles of one mark
ALIKE = 0.05  # [1] between a circle's radius and the mark's
MOST_TRIED = 4  # poses of one threshold
TURNS = 180  # angles tried
LEAST_MATCH = 0.5  # correlation of the bars with what is around the rings
MOSTLY, PARTLY = 0.5, 0.2  # of the surroundings that must be in the picture to tell the mark; to tell its angle
DISTINCT = 0.7  # of the best correlation, above which another angle would do as well


@dataclass(frozen=True)
class Circle:
    """A circle on the level plane one unit below the camera, right and forward."""

    x: float
    y: float
    radius: float
    light: float  # +1: lighter inside, -1: darker


class RingSearch:
    """Poses that a ring mark may have."""

    def __init__(self, camera: CameraModel, mark: RingMark) -> None:
        """For the pictures of one camera."""
        self._camera, self._mark = camera, mark
        circles = mark.circles()
        central = circles[np.hypot(circles[:, 0], circles[:, 1]) == 0.0]
        self._radii, self._lights = central[:, 2], central[:, 3]
        self._polar, self._pattern = _around(mark)

    def poses(
        self, region: Image, corner: tuple[int, int], level: LevelAxes, angle: float
    ) -> Iterator[list[tuple[MarkPose, bool]]]:
        """Likeliest poses first, a list for each threshold; with each whether its angle is known.

        region: a part of the picture, its upper left pixel at `corner` (x, y); angle [rad]: of the poses for which the
        picture does not tell.
        """
        for mask, polarity in masks(region):
            if polarity < 0:
                continue
            found = self._circles(mask, corner, level)
            guesses = self._concentric(found, level)
            turned = (self._turned(region, corner, guess, level, angle) for guess in guesses[:MOST_TRIED])
            yield [pose for pose in turned if pose is not None]

    def _circles(self, mask: Image, corner: tuple[int, int], level: LevelAxes) -> list[Circle]:
        contours, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        if len(contours) == 0:
            return []
        height, width = mask.shape
        focal = math.sqrt(self._camera.fx * self._camera.fy)
        found = []
        for contour, parent in zip(contours, hierarchy.reshape(-1, 4)[:, 3], strict=True):
            if len(contour) < SHORTEST:
                continue
            points = contour.reshape(-1, 2)
            x, y, w, h = cv2.boundingRect(contour)
            cut = x <= 0 or y <= 0 or x + w >= width or y + h >= height
            if not cut and 4.0 * math.pi * cv2.contourArea(contour) < ROUND * len(contour) ** 2:
                continue
            inside = np.all((points > 0) & (points < (width - 1, height - 1)), axis=1)
            points = points[inside]
            if len(points) < SHORTEST:
                continue
            flat = on_pad_plane(points[:: max(1, len(points) // 120)] + np.array(corner, float), self._camera, level)
            if not np.all(np.isfinite(flat)):
                continue
            right, forward, radius = fit_circle(flat)
            away = flat - (right, forward)
            residual = np.hypot(*away.T) - radius
            pixel = 1.0 / focal
            if math.sqrt(float(np.mean(residual**2))) > RAGGED * radius + pixel:
                continue
            if _arc(away) < LEAST_ARC:
                continue
            light = 1.0 if parent < 0 else -1.0
            # the contour runs through the light component's outermost pixels, half a pixel from its edge
            found.append(Circle(right, forward, radius + 0.5 * light * pixel, light))
        return found

    def _concentric(self, found: list[Circle], level: LevelAxes) -> list[MarkPose]:
        """Poses, the most supported first; their angle is 0."""
        if not found:
            return []
        table = np.array([(c.x, c.y, c.radius, c.light) for c in found])
        guesses: list[tuple[int, float, MarkPose]] = []
        for x, y, radius, light in table.tolist():
            near = np.hypot(table[:, 0] - x, table[:, 1] - y) < TOGETHER * np.maximum(table[:, 2], radius)
            for model in self._radii[self._lights == light].tolist():
                height = model / radius
                # of each circle of the mark, how far the nearest circle seen is from it
                off = np.abs(np.log(table[near, 2][None] * height / self._radii[:, None]))
                off[table[near, 3][None] != self._lights[:, None]] = np.inf
                nearest = off.min(axis=1)
                support = int(np.sum(nearest < ALIKE))
                if support < 2:
                    continue
                error = float(np.sum(nearest[nearest < ALIKE]) / support)
                guesses.append((support, error, MarkPose(from_pad_plane(x, y, height, level), 0.0)))
        guesses.sort(key=lambda guess: (-guess[0], guess[1]))
        different: list[MarkPose] = []
        for _, _, pose in guesses:
            if all(np.linalg.norm(pose.position - other.position) > 0.1 * pose.position[2] for other in different):
                different.append(pose)
        return different

    def _turned(
        self, region: Image, corner: tuple[int, int], pose: MarkPose, level: LevelAxes, angle: float
    ) -> tuple[MarkPose, bool] | None:
        """The pose with the angle at which the bars match best, and whether enough is in the picture to tell.

        None where the bars should be seen and are not.
        """
        pixels = self._camera.project(place(self._polar, pose, level)) - corner
        height, width = region.shape
        with np.errstate(invalid="ignore"):
            seen = np.all((pixels >= 0) & (pixels <= (width - 1, height - 1)), axis=1)
        places = np.where(seen[:, None], pixels, -1.0).astype(np.float32)
        grey = cv2.remap(region, places[:, 0], places[:, 1], cv2.INTER_LINEAR, borderValue=0).ravel().astype(float)
        shape = self._pattern.shape
        grey, weight = (grey * seen).reshape(shape), seen.reshape(shape).astype(float)
        if weight.mean() < PARTLY:
            return MarkPose(pose.position, angle), False
        grey = np.where(weight > 0, grey - grey.sum() / weight.sum(), 0.0)
        match = _correlation(grey, self._pattern) / np.sqrt(
            np.maximum(np.sum(grey**2) * _correlation(weight, self._pattern**2), 1e-9)
        )
        turn = int(np.argmax(match))
        others = np.delete(np.roll(match, -turn), np.arange(-TURNS // 18, TURNS // 18 + 1))
        if match[turn] < LEAST_MATCH or others.max() > DISTINCT * match[turn]:
            return None if weight.mean() >= MOSTLY else (MarkPose(pose.position, angle), False)
        return MarkPose(pose.position, turn * 2.0 * math.pi / TURNS), True


def fit_circle(points: Floats) -> tuple[float, float, float]:
    """Centre x, y and radius of the circle nearest to points (N, 2) in Taubin's sense: short arcs leave no bias."""
    middle = points.mean(axis=0)
    p = points - middle
    z = np.einsum("ij,ij->i", p, p)
    mean = float(z.mean())
    scale = 2.0 * math.sqrt(max(mean, 1e-300))
    _, _, v = np.linalg.svd(np.column_stack([(z - mean) / scale, p]), full_matrices=False)
    a = v[2]
    a0 = a[0] / scale
    if abs(a0) < 1e-12:
        return math.nan, math.nan, math.inf
    centre = -a[1:] / (2.0 * a0)
    radius = math.sqrt(float(a[1:] @ a[1:] + 4.0 * a0 * a0 * mean)) / (2.0 * abs(a0))
    return float(centre[0] + middle[0]), float(centre[1] + middle[1]), radius


def _arc(away: Floats) -> float:
    """Share of a whole turn that points (N, 2) about the origin cover, in 36 sectors."""
    sector = np.floor(np.arctan2(away[:, 1], away[:, 0]) / (2.0 * math.pi) * 36.0).astype(int) % 36
    return len(np.unique(sector)) / 36.0


def _around(mark: RingMark) -> tuple[Floats, Floats]:
    """Points (R TURNS, 2) [m] around the rings, clockwise from the axis, and the bars there (R, TURNS), mean 0."""
    radius = np.linspace(0.54, 0.96, 22) * mark.size
    azimuth = np.arange(TURNS) * 2.0 * math.pi / TURNS
    x, y = radius[:, None] * np.sin(azimuth), radius[:, None] * np.cos(azimuth)
    points = np.column_stack([x.ravel(), y.ravel()])
    white = np.zeros(len(points))
    for corners in mark.bars():
        flat = corners.astype(np.float32).reshape(-1, 1, 2)
        white += [cv2.pointPolygonTest(flat, (float(a), float(b)), False) >= 0 for a, b in points]
    pattern = white.reshape(len(radius), TURNS)
    return points, pattern - pattern.mean()


def _correlation(seen: Floats, pattern: Floats) -> Floats:
    """Circular correlation (TURNS,) over the azimuth: at k, of what is seen with the pattern turned clockwise by k."""
    spectrum = np.fft.rfft(seen, axis=1) * np.conj(np.fft.rfft(pattern, axis=1))
    return np.asarray(np.fft.irfft(spectrum.sum(axis=0), n=seen.shape[1]))
