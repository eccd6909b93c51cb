"""The H pad's front end: finds the mark without knowledge, follows it with a prediction, and goes on when it is cut.

Finding: threshold in the region of interest, median, contours, affine moments, pose from area and second moments on
the level plane, edge fit (Lei 2012 section 2.2.1, and sub-pixel edges). Following: edge fit from the prediction.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.contours import Candidate, ShapeTemplate, candidates
from estimators.vision.edge_fit import EdgeFit, fit_outline
from estimators.vision.outline import OutlineSamples
from estimators.vision.pose import (
    LevelAxes,
    MarkPose,
    from_pad_plane,
    level_axes,
    on_pad_plane,
    place,
    wrap_axis,
)
from estimators.vision.sighting import PadPrediction, PadSighting
from estimators.vision.threshold import above, class_contrast, local_mask, lower_otsu, modified_otsu, otsu
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import HMark

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

SMALLEST_SIDE = 30.0  # [px] a mark smaller than this has strokes of some 6 px: edges that run into one another
ROUGH, NEAR, FINE = 2.5, 0.6, 0.4  # equation 4: worth a threshold of its own; good as it is; good after that
MOST_TRIED = 5  # contours of one threshold
SHARPEST_REACH = 10.0  # [px] search on one level of the pyramid
RAGGED = 0.9  # [px] RMS beyond which edges are not the mark's; chance edges give 1.7
LEAST_CONTRAST = 8.0  # [grey levels]
LOCAL_MARGIN = 12.0  # [grey levels] above the surroundings' mean
# share of the model's edge points that must agree: a U or a window laid over an H reaches 0.65, an H with a fifth of
# its area hidden 0.68
FOLLOWED, FOUND = 0.67, 0.75
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
        self._template = ShapeTemplate.of(outline)
        self._area = float(cv2.contourArea(outline.astype(np.float32)))  # [m^2]
        moments = cv2.moments(outline.astype(np.float32))
        self._lengthwise = moments["mu02"] / moments["mu20"]  # second moment along the axis over that across it
        grid = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 41), np.linspace(-0.5, 0.5, 41)), axis=-1).reshape(-1, 2)
        grid *= [mark.width, mark.leg]
        within = (np.abs(grid[:, 0]) > mark.width / 2 - mark.stroke) | (np.abs(grid[:, 1]) < mark.stroke / 2)
        self._inside = grid[within]
        self._size = max(mark.leg, mark.width)

    def see(self, image: Image, attitude: Floats, prediction: PadPrediction | None = None) -> PadSighting | None:
        """The mark in a picture (H, W) uint8, or None.

        attitude: (4,) wxyz, body to world, at the picture's time. prediction: where the filter expects the mark, or
        None. A mark that is not wholly in the picture is seen only with a prediction.
        """
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
        spread = self._spread(prediction)
        stroke = self.mark.stroke * min(self.camera.fx, self.camera.fy) / depth
        reach = 3.0 * spread + 1.5
        if reach > 1.5 * stroke:
            return None  # another stroke may be nearer than the right one
        factor = 1
        while reach / factor > SHARPEST_REACH and factor < 8:
            factor *= 2
        std = np.append(prediction.std_position, prediction.std_angle)
        prior = np.maximum(3.0 * std, np.append(np.full(3, 0.01 + 0.01 * depth), 0.035))
        fit = self._refine(image, level, start, prior, reach, factor, 0)
        if fit is None or not self._agrees(fit, start, std):
            return None
        return self._sighting(fit, tracked=True)

    def _spread(self, prediction: PadPrediction) -> float:
        """One standard deviation of where the outline's points lie in the picture [px], the worst of them."""
        x, y, depth = prediction.position
        focal = max(self.camera.fx, self.camera.fy)
        # what counts is how far the part in the picture reaches from the centre
        radius = min(0.7 * self._size * focal / depth, math.hypot(self.camera.width, self.camera.height))
        lateral = focal / depth * max(prediction.std_position[0], prediction.std_position[1])
        along = prediction.std_position[2] / depth * (radius + focal * math.hypot(x, y) / depth)
        return math.sqrt(lateral**2 + along**2 + (prediction.std_angle * radius) ** 2)

    def _refine(
        self, image: Image, level: LevelAxes, start: MarkPose, prior: Floats, reach: float, factor: int, polarity: int
    ) -> EdgeFit | None:
        """Edge fit on a reduced picture where the search is wide, then on the picture itself."""
        if factor > 1:
            small, camera = reduced(image, self.camera, factor)
            coarse = fit_outline(
                small, camera, self._samples, level, start, prior_std=prior, reach=reach / factor,
                polarity=polarity, tilt_std=self.tilt_std, iterations=6,
            )  # fmt: skip
            if coarse is None:
                return None
            start, polarity = coarse.pose, 1 if coarse.contrast > 0 else -1
            reach = 3.0 + 0.5 * factor
        return fit_outline(
            image, self.camera, self._samples, level, start, prior_std=prior, reach=reach,
            polarity=polarity, tilt_std=self.tilt_std,
        )  # fmt: skip

    def _agrees(self, fit: EdgeFit, start: MarkPose, std: Floats) -> bool:
        """Whether a followed mark is good enough, and where it was expected."""
        if not self._sound(fit, share=FOLLOWED):
            return False
        difference = np.append(fit.pose.position - start.position, fit.pose.angle - start.angle)
        fitted = np.sqrt(np.diag(fit.covariance))
        return bool(np.all(np.abs(difference) <= GATE * np.hypot(std, fitted) + 0.002 * fit.pose.position[2]))

    @staticmethod
    def _sound(fit: EdgeFit, share: float) -> bool:
        return fit.used >= share * fit.expected and fit.residual <= RAGGED and abs(fit.contrast) >= LEAST_CONTRAST

    # finding

    def _acquire(self, image: Image, level: LevelAxes, prediction: PadPrediction | None) -> PadSighting | None:
        if prediction is not None and self._too_near(prediction):
            return None
        found = self._search(image, level, prediction)
        if found is None and prediction is not None:
            found = self._search(image, level, None)  # the filter may be mistaken, and surer than it should be
        return found

    def _too_near(self, prediction: PadPrediction) -> bool:
        """Whether the mark is surely larger than the picture."""
        farthest = prediction.position[2] + 5.0 * prediction.std_position[2]
        widest = max(self.camera.fx / self.camera.width, self.camera.fy / self.camera.height)
        return bool(farthest < self._size * widest)

    def _search(self, image: Image, level: LevelAxes, prediction: PadPrediction | None) -> PadSighting | None:
        left, top, right, bottom = self._region(prediction)
        if right - left < SMALLEST_SIDE or bottom - top < SMALLEST_SIDE:
            return None
        region = np.asarray(cv2.medianBlur(np.ascontiguousarray(image[top:bottom, left:right]), 3), np.uint8)
        area = self._area_bounds(prediction, region.size)
        for mask, polarity in self._masks(region):
            if cv2.countNonZero(mask) < area[0]:
                continue
            rough = candidates(mask, self._template, area=area, worst=ROUGH, solidity_margin=0.25)
            fits = (self._examined(image, region, (left, top), c, polarity, area, level) for c in rough[:MOST_TRIED])
            best = min((fit for fit in fits if fit is not None), key=lambda fit: fit.residual, default=None)
            if best is not None:
                return self._sighting(best, tracked=False)
        return None

    def _examined(
        self,
        image: Image,
        region: Image,
        corner: tuple[int, int],
        rough: Candidate,
        polarity: int,
        area: tuple[float, float],
        level: LevelAxes,
    ) -> EdgeFit | None:
        """The mark where a rough contour is, thresholded again by Otsu in the contour's own surroundings."""
        x0, y0, x1, y1 = rough.box
        margin = 4 + (x1 - x0 + y1 - y0) // 8
        x0, y0 = max(x0 - margin, 0), max(y0 - margin, 0)
        patch = np.ascontiguousarray(region[y0 : y1 + margin, x0 : x1 + margin])
        mask = above(patch, otsu(patch), below=polarity < 0)
        sharp = candidates(mask, self._template, area=area, worst=FINE, solidity_margin=0.15)
        starts = self._starts(sharp[0], (corner[0] + x0, corner[1] + y0), level) if sharp else []
        if not sharp and rough.mismatch <= NEAR:
            starts = self._starts(rough, corner, level)  # uneven light: the first threshold may have been the better
        fits = (self._verified(image, level, start, polarity) for start in starts)
        return min((fit for fit in fits if fit is not None), key=lambda fit: fit.residual, default=None)

    def _region(self, prediction: PadPrediction | None) -> tuple[int, int, int, int]:
        """Left, top, right, bottom [px] of where the mark is expected within three standard deviations."""
        whole = (0, 0, self.camera.width, self.camera.height)
        if prediction is None or prediction.position[2] <= 0.0:
            return whole
        centre = self.camera.project(np.asarray(prediction.position, float))[0]
        nearest = max(prediction.position[2] - 3.0 * prediction.std_position[2], 0.3 * prediction.position[2])
        half = max(self.camera.fx, self.camera.fy) * 0.75 * self._size / nearest + 3.0 * self._spread(prediction) + 8.0
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

    def _masks(self, region: Image) -> Iterator[tuple[Image, int]]:
        """Binary pictures to try, with the mark's polarity: global thresholds first, then local ones."""
        plain = otsu(region)
        if class_contrast(region, plain) >= LEAST_CONTRAST:
            yield above(region, plain), 1
            raised = modified_otsu(region, "open")
            if raised is not None and abs(raised - plain) > 2:
                yield above(region, raised), 1
            yield above(region, plain, below=True), -1
            lower = lower_otsu(region, plain)
            if lower is not None:
                yield above(region, lower), 1
        window = int(min(max(min(region.shape) // 3, 31), 121)) | 1
        yield local_mask(region, window, LOCAL_MARGIN), 1
        yield local_mask(np.asarray(cv2.bitwise_not(region), np.uint8), window, LOCAL_MARGIN), -1

    def _starts(self, candidate: Candidate, corner: tuple[int, int], level: LevelAxes) -> list[MarkPose]:
        """Poses from a contour's area, centroid and second moments on the level plane below the camera."""
        pixels = candidate.contour.reshape(-1, 2)[:: max(1, len(candidate.contour) // 400)].astype(float) + corner
        flat = on_pad_plane(pixels, self.camera, level)
        if not np.all(np.isfinite(flat)):
            return []
        polygon = flat.astype(np.float32)
        m = cv2.moments(polygon)
        if m["m00"] <= 0.0:
            return []
        # the contour runs through the outermost pixels' centres: the filled mask's area is the mark's
        area = m["m00"] * candidate.area / max(cv2.contourArea(candidate.contour), 1.0)
        height = math.sqrt(self._area / area)
        position = from_pad_plane(m["m10"] / m["m00"], m["m01"] / m["m00"], height, level)
        longest = 0.5 * math.atan2(2.0 * m["mu11"], m["mu20"] - m["mu02"])  # from right towards forward
        if self._lengthwise < 0.8:
            angles = [-longest]
        elif self._lengthwise > 1.25:
            angles = [math.pi / 2 - longest]
        else:  # no longest direction: the sides' two
            side = math.radians(cv2.minAreaRect(polygon)[2])
            angles = [-side, math.pi / 2 - side]
        return [MarkPose(position, angle) for angle in angles]

    def _verified(self, image: Image, level: LevelAxes, start: MarkPose, polarity: int) -> EdgeFit | None:
        depth = start.position[2]
        stroke = self.mark.stroke * min(self.camera.fx, self.camera.fy) / depth
        factor = 1
        while stroke / (2 * factor) > 12.0 and factor < 8:
            factor *= 2
        prior = np.array([0.2 * depth, 0.2 * depth, 0.3 * depth, 0.5])
        fit = self._refine(image, level, start, prior, 6.0 * factor, factor, polarity)
        if fit is None or not self._sound(fit, share=FOUND) or fit.used < 60:
            return None
        # a small shape is fitted by chance more easily
        if fit.residual > 0.02 * self._size * self.camera.fy / fit.pose.position[2]:
            return None
        whole = self.camera.contains(self.camera.project(place(self._outline, fit.pose, fit.level)))
        return fit if bool(whole.all()) else None

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
            source="acquired" if not tracked else "tracked" if self.camera.contains(corners).all() else "cut",
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
