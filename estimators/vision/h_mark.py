"""The H pad's front end: finds the mark without knowledge, follows it with a prediction, and goes on when it is cut.

Finding: threshold in the region of interest, median, contours, affine moments, pose from area and second moments on
the level plane, edge fit (Lei 2012 section 2.2.1, and sub-pixel edges). Following: edge fit from the prediction.
"""

import math
from dataclasses import replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.cut_h import SHORTEST_RUN, SHORTEST_RUN_INSIDE, cut_starts, enough_seen, long_contours
from estimators.vision.edge_fit import EdgeFit, fit_outline
from estimators.vision.occlusion import covered_from_one_side
from estimators.vision.outline import OutlineSamples
from estimators.vision.pose import (
    LevelAxes,
    MarkPose,
    level_axes,
    place,
    wrap_axis,
)
from estimators.vision.search import MarkSearch, Sought
from estimators.vision.sighting import PadPrediction, PadSighting
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import HMark

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

SMALLEST_SIDE = 30.0  # [px] a mark smaller than this has strokes of some 6 px: edges that run into one another
SHARPEST_REACH = 10.0  # [px] search on one level of the pyramid
WIDEST_REACH = 2.2  # [strokes] the next edge of the same contrast is two gaps, some three strokes, away
THINNEST_STROKE = 5.0  # [px] on a reduced picture
RAGGED = 0.9  # [px] RMS beyond which edges are not the mark's; chance edges give 1.7
SHARP = 0.35  # of `EdgeFit.sharpness`: a ramp of 6 px; along a longer one the edges' places are chance
EVERY_WAY = 0.25  # of the edges that face one way: where fewer agree, motion has blurred them (glare leaves a third)
LEAST_CONTRAST = 8.0  # [grey levels]
# share of the model's edge points that must agree: a U or a window laid over an H reaches 0.65, an H with a fifth of
# its area hidden 0.68
FOLLOWED, FOLLOWED_CUT, FOUND = 0.67, 0.5, 0.75
PRIOR_WIDTH = 3.0  # a prediction holds a fit with this many times its standard deviation: loosely
GATE = 5.0  # standard deviations between prediction and a cut or tracked mark


def reduced(image: Image, camera: CameraModel, factor: int) -> tuple[Image, CameraModel]:
    """Picture (H, W) and camera with `factor` x `factor` pixels averaged into one."""
    if factor == 1:
        return image, camera
    height, width = image.shape[0] // factor, image.shape[1] // factor
    small = cv2.resize(
        image[: height * factor, : width * factor], (width, height), interpolation=cv2.INTER_AREA
    ).astype(np.uint8, copy=False)
    return small, replace(
        camera, width=width, height=height, fx=camera.fx / factor, fy=camera.fy / factor,
        cx=(camera.cx + 0.5) / factor - 0.5, cy=(camera.cy + 0.5) / factor - 0.5,
    )  # fmt: skip


class HMarkFrontEnd:
    """Looks for one H in the pictures of one camera. Keeps nothing from one picture to the next."""

    def __init__(
        self,
        camera: CameraModel,
        mount: CameraMount,
        mark: HMark,
        *,
        variant: Literal["helideck"] = "helideck",
        tilt_std: float = math.radians(0.3),
        scale_std: float = 5e-4,
        pixel_std: float = 0.03,
    ) -> None:
        """What the pictures cannot tell about themselves, as standard deviations that enter the answer's covariance.

        tilt_std [rad] of roll and pitch, large where the tilt is to be solved from the picture; scale_std [1] of focal
        length and mark's size; pixel_std [px] of the place of all edges together (principal point, texture filter).
        """
        if variant != "helideck":
            raise ValueError(f"variant: no front end named {variant!r}; there is 'helideck'")
        self.camera, self.mount, self.mark, self.tilt_std = camera, mount, mark, tilt_std
        self.scale_std, self.pixel_std = scale_std, pixel_std
        outline = mark.outline()
        self._outline = outline
        self._samples = OutlineSamples.of(outline)
        self._marks = MarkSearch(camera, outline)
        self._area = float(cv2.contourArea(outline.astype(np.float32)))  # [m^2]
        grid = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 41), np.linspace(-0.5, 0.5, 41)), axis=-1).reshape(-1, 2)
        grid *= [mark.width, mark.leg]
        within = (np.abs(grid[:, 0]) > mark.width / 2 - mark.stroke) | (np.abs(grid[:, 1]) < mark.stroke / 2)
        self._inside = grid[within]
        self._size = max(mark.leg, mark.width)

    def see(self, image: Image, attitude: Floats, prediction: PadPrediction | None = None) -> PadSighting | None:
        """The mark in a picture (H, W) uint8, or (H, W, 3) RGB which is made grey; or None.

        attitude: (4,) wxyz, body to world, at the picture's time. prediction: where the filter expects the mark, or
        None. Without one, a mark that is not wholly in the picture is found where three of its leg ends are seen, or
        both inner corners of one side.
        """
        if image.ndim == 3:
            image = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
        if image.shape != (self.camera.height, self.camera.width):
            raise ValueError(
                f"picture: {image.shape[1]}x{image.shape[0]}, the camera has {self.camera.width}x{self.camera.height}"
            )
        level = level_axes(attitude, self.mount)
        if prediction is not None:
            sighting = self._track(image, level, prediction)
            if sighting is not None:
                return sighting
        return self._acquire(image, level, prediction)

    # following

    def _track(self, image: Image, level: LevelAxes, prediction: PadPrediction) -> PadSighting | None:
        start = MarkPose(np.asarray(prediction.position, float), float(prediction.angle))
        depth = start.position[2]
        if depth <= 0.05:
            return None
        std = np.append(prediction.std_position, prediction.std_angle)
        spread = self._spread(start.position, std)
        stroke = self.mark.stroke * min(self.camera.fx, self.camera.fy) / depth
        reach = 3.0 * spread + 1.5
        if reach > WIDEST_REACH * stroke:
            return None
        factor = 1
        while reach / factor > SHARPEST_REACH and stroke / (2 * factor) >= THINNEST_STROKE and factor < 8:
            factor *= 2
        prior = np.maximum(PRIOR_WIDTH * std, np.append(np.full(3, 0.01 + 0.01 * depth), 0.035))
        fit = self._refine(image, level, start, prior, reach, factor, 0)
        if fit is None or not self._agrees(fit, start, std):
            return None
        return self._sighting(fit, tracked=True)

    def _spread(self, position: Floats, std: Floats) -> float:
        """One standard deviation of where the outline's points lie in the picture [px], the worst of them.

        position (3,) [m] in camera axes; std (4,) of x, y, z [m], angle [rad].
        """
        x, y, depth = position
        focal = max(self.camera.fx, self.camera.fy)
        # what counts is how far the part in the picture reaches from the centre
        radius = min(0.7 * self._size * focal / depth, math.hypot(self.camera.width, self.camera.height))
        lateral = focal / depth * max(std[0], std[1])
        along = std[2] / depth * (radius + focal * math.hypot(x, y) / depth)
        return math.sqrt(lateral**2 + along**2 + (std[3] * radius) ** 2)

    def _refine(
        self,
        image: Image,
        level: LevelAxes,
        start: MarkPose,
        prior: Floats,
        reach: float,
        factor: int,
        polarity: int,
        *,
        blurred: bool = True,
    ) -> EdgeFit | None:
        """Edge fit on a reduced picture where the search is wide, then on the picture itself.

        Where its edges are blurred, and that is allowed, the answer is that of the largest reduced picture in which
        they are sharp, its residual counted in pixels of the whole picture.
        """
        stroke = self.mark.stroke * min(self.camera.fx, self.camera.fy) / start.position[2]
        if factor > 1:
            coarse = self._fit(image, level, start, prior, reach, factor, polarity)
            if coarse is None:
                return None
            start, polarity = coarse.pose, 1 if coarse.contrast > 0 else -1
            # edges that the small picture was too small for are still as far away as they were
            left_open = np.minimum(np.sqrt(np.diag(coarse.covariance)), prior / PRIOR_WIDTH)
            reach = min(reach, max(3.0 + 0.5 * factor, 3.0 * self._spread(start.position, left_open)))
        factor = 1
        while factor == 1 or stroke / factor >= THINNEST_STROKE:
            fit = self._fit(image, level, start, prior, reach, factor, polarity)
            if fit is not None and fit.sharpness >= SHARP and fit.residual <= RAGGED:
                return replace(fit, residual=fit.residual * factor)
            if not blurred:
                break
            factor *= 2
        return None

    def _fit(
        self, image: Image, level: LevelAxes, start: MarkPose, prior: Floats, reach: float, factor: int, polarity: int
    ) -> EdgeFit | None:
        """Edge fit on a picture reduced by a factor; reach in pixels of the whole picture."""
        small, camera = reduced(image, self.camera, factor)
        return fit_outline(
            small, camera, self._samples, level, start, prior_std=prior, reach=max(reach / factor, 2.0),
            polarity=polarity, tilt_std=self.tilt_std, iterations=8 if factor == 1 else 6,
        )  # fmt: skip

    def _agrees(self, fit: EdgeFit, start: MarkPose, std: Floats) -> bool:
        """Whether a followed mark is good enough, and where it was expected."""
        whole = self.camera.contains(self.camera.project(place(self._outline, fit.pose, fit.level))).all()
        covered = covered_from_one_side(fit.places, fit.agree, anew=False)
        if not self._sound(fit, 0.0 if covered else FOLLOWED if whole else FOLLOWED_CUT):
            return False
        difference = np.append(fit.pose.position - start.position, fit.pose.angle - start.angle)
        fitted = np.sqrt(np.diag(fit.covariance))
        return bool(np.all(np.abs(difference) <= GATE * np.hypot(std, fitted) + 0.002 * fit.pose.position[2]))

    @staticmethod
    def _sound(fit: EdgeFit, share: float) -> bool:
        """Whether this share of the edges agrees, or, with none demanded, what a cover leaves of them."""
        enough = share == 0.0 or (fit.used >= share * fit.expected and fit.facing >= EVERY_WAY)
        return enough and abs(fit.contrast) >= LEAST_CONTRAST

    # finding

    def _acquire(self, image: Image, level: LevelAxes, prediction: PadPrediction | None) -> PadSighting | None:
        whole = Sought(image, 0, 0)
        if prediction is not None and self._too_near(prediction):
            return self._search_part(image, level, whole)
        found = None
        if prediction is not None:
            left, top, right, bottom = self._region(prediction)
            if min(right - left, bottom - top) >= SMALLEST_SIDE:
                part = Sought(image[top:bottom, left:right], left, top)
                found = self._search(image, level, part, prediction)
        # the filter may be mistaken, and surer than it should be
        return found or self._search(image, level, whole, None) or self._search_part(image, level, whole)

    def _search_part(self, image: Image, level: LevelAxes, sought: Sought) -> PadSighting | None:
        """A mark that is cut or partly hidden, by those of its edges that are seen."""
        _, camera = reduced(image, self.camera, sought.times)
        for traced, polarity in sought.traced():
            for contour, cut in long_contours(traced, 3.0 * SMALLEST_SIDE):
                run = SHORTEST_RUN if cut else SHORTEST_RUN_INSIDE
                for start, _ in cut_starts(contour, camera, level, self.mark, np.full(2, 0.02), shortest=run):
                    fit = self._verified(image, level, start, polarity, whole=False)
                    if fit is not None:
                        return self._sighting(fit, tracked=False)
        return None

    def _too_near(self, prediction: PadPrediction) -> bool:
        """Whether the mark is surely larger than the picture."""
        farthest = prediction.position[2] + 5.0 * prediction.std_position[2]
        widest = max(self.camera.fx / self.camera.width, self.camera.fy / self.camera.height)
        return bool(farthest < self._size * widest)

    def _search(
        self, image: Image, level: LevelAxes, sought: Sought, prediction: PadPrediction | None
    ) -> PadSighting | None:
        area = self._area_bounds(prediction, sought.region.size)
        for poses in self._marks.poses(sought, area, level):
            fits = (self._verified(image, level, start, polarity) for start, polarity in poses)
            best = min((fit for fit in fits if fit is not None), key=lambda fit: fit.residual, default=None)
            if best is not None:
                return self._sighting(best, tracked=False)
        return None

    def _region(self, prediction: PadPrediction) -> tuple[int, int, int, int]:
        """Left, top, right, bottom [px] of where the mark is expected within three standard deviations."""
        whole = (0, 0, self.camera.width, self.camera.height)
        if prediction.position[2] <= 0.0:
            return whole
        centre = self.camera.project(np.asarray(prediction.position, float))[0]
        std = np.append(prediction.std_position, prediction.std_angle)
        nearest = max(prediction.position[2] - 3.0 * prediction.std_position[2], 0.3 * prediction.position[2])
        reach = 3.0 * self._spread(prediction.position, std) + 8.0
        half = max(self.camera.fx, self.camera.fy) * 0.75 * self._size / nearest + reach
        low = np.clip(centre - half, 0, [self.camera.width, self.camera.height]).astype(int)
        high = np.clip(centre + half + 1, 0, [self.camera.width, self.camera.height]).astype(int)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    def _area_bounds(self, prediction: PadPrediction | None, pixels: int) -> tuple[float, float]:
        """Least and largest area [px^2] of the mark."""
        least = self._area / self._size**2 * SMALLEST_SIDE**2
        if prediction is None or prediction.position[2] <= 0.0:
            return least, 0.6 * pixels
        depth, std = prediction.position[2], prediction.std_position[2]
        scale = self._area * self.camera.fx * self.camera.fy
        far, near = depth + 4.0 * std, max(depth - 4.0 * std, 0.3 * depth)
        return max(least, 0.6 * scale / far**2), max(2.0 * least, 1.6 * scale / near**2)

    def _verified(
        self, image: Image, level: LevelAxes, start: MarkPose, polarity: int, *, whole: bool = True
    ) -> EdgeFit | None:
        depth = start.position[2]
        stroke = self.mark.stroke * min(self.camera.fx, self.camera.fy) / depth
        factor = 1
        while stroke / (2 * factor) > 12.0 and factor < 8:
            factor *= 2
        prior = np.array([0.2 * depth, 0.2 * depth, 0.3 * depth, 0.5])
        fit = self._refine(image, level, start, prior, 6.0 * factor, factor, polarity, blurred=whole)
        if fit is None or fit.used < 60:
            return None
        covered = not whole and covered_from_one_side(fit.places, fit.agree, anew=True)
        if not self._sound(fit, 0.0 if covered else FOUND):
            return None
        # a small shape is fitted by chance more easily
        if fit.residual > 0.02 * self._size * self.camera.fy / fit.pose.position[2]:
            return None
        corners = self.camera.project(place(self._outline, fit.pose, fit.level))
        seen = bool(self.camera.contains(corners).all()) if whole else enough_seen(corners, self.camera)
        return fit if seen else None

    # answering

    def _sighting(self, fit: EdgeFit, *, tracked: bool) -> PadSighting:
        corners = self.camera.project(place(self._outline, fit.pose, fit.level))
        inside = self.camera.contains(self.camera.project(place(self._inside, fit.pose, fit.level)), -0.5)
        visible = float(np.mean(inside))
        covariance = fit.covariance + self._systematic(fit.pose.position)
        std = np.sqrt(np.diag(covariance))
        quality = fit.used / fit.expected * min(1.0, 0.3 / max(fit.residual, 1e-6))
        return PadSighting(
            position=fit.pose.position,
            angle=wrap_axis(fit.pose.angle),
            std_position=std[:3],
            std_angle=float(std[3]),
            covariance=covariance,
            quality=float(min(quality, 1.0)),
            visible=visible,
            outline=corners,
            source="cut" if not self.camera.contains(corners).all() else "tracked" if tracked else "acquired",
            up=fit.level.up,
            residual=fit.residual,
            contrast=fit.contrast,
        )

    def _systematic(self, position: Floats) -> Floats:
        """Covariance (4, 4) of what does not average out over a picture's edges."""
        along = np.append(self.scale_std * position, 0.0)  # a wrong scale moves the mark along its ray
        per_pixel = position[2] / np.array([self.camera.fx, self.camera.fy])
        across = np.array([per_pixel[0], per_pixel[1], 0.0, per_pixel[0] / self._size])
        return np.asarray(np.outer(along, along) + np.diag((self.pixel_std * across) ** 2))
