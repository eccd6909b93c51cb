"""Where in a picture a mark may be, with no pose known: threshold, contours, affine moments, a pose from moments."""

import math
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.contours import Candidate, ShapeTemplate, Traced, candidates
from estimators.vision.pose import LevelAxes, MarkPose, from_pad_plane, on_pad_plane
from estimators.vision.threshold import above, class_contrast, local_mask, lower_otsu, modified_otsu, otsu
from flightlog.camera import CameraModel

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

ROUGH, NEAR, FINE = 2.5, 0.6, 0.4  # equation 4: worth a threshold of its own; good as it is; good after that
MOST_TRIED = 5  # contours of one threshold
LEAST_CONTRAST = 8.0  # [grey levels] between the classes of a threshold
LOCAL_MARGIN = 12.0  # [grey levels] above the surroundings' mean
LARGE = 100_000  # [px] of a region that is sought through at half its size: most of the time goes into grass


def masks(region: Image) -> Iterator[tuple[Image, int]]:
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


class Sought:
    """A part of a picture to look for a mark in: median-filtered, its binary pictures made when first asked for."""

    def __init__(self, picture: Image, left: int, top: int) -> None:
        """Part (H, W) of a picture whose upper left pixel lies at (left, top) of it."""
        self.corner = (left, top)
        self.region = np.asarray(cv2.medianBlur(np.ascontiguousarray(picture), 3), np.uint8)
        self.times = 2 if self.region.size > LARGE else 1  # by which `traced` is reduced
        self._traced: list[tuple[Traced, int]] = []
        self._more = masks(self._reduced())

    def _reduced(self) -> Image:
        if self.times == 1:
            return self.region
        height, width = self.region.shape[0] // self.times, self.region.shape[1] // self.times
        whole = self.region[: height * self.times, : width * self.times]
        small = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
        return np.asarray(cv2.medianBlur(small, 3), np.uint8)

    def traced(self) -> Iterator[tuple[Traced, int]]:
        """Contours of the binary pictures, with the mark's polarity, likeliest threshold first."""
        yield from self._traced
        for mask, polarity in self._more:
            self._traced.append((Traced.of(mask), polarity))
            yield self._traced[-1]


class MarkSearch:
    """Poses that a flat mark of known outline may have, from the shape of contours alone."""

    def __init__(self, camera: CameraModel, outline: Floats) -> None:
        """Outline (N, 2) [m], mark axes."""
        self.camera = camera
        self._template = ShapeTemplate.of(outline)
        moments = cv2.moments(outline.astype(np.float32))
        self._area = moments["m00"]  # [m^2]
        self._lengthwise = moments["mu02"] / moments["mu20"]  # second moment along the axis over that across it

    def poses(
        self, sought: Sought, area: tuple[float, float], level: LevelAxes
    ) -> Iterator[list[tuple[MarkPose, int]]]:
        """Poses with the mark's polarity (+1 light, -1 dark), a list for each threshold, likeliest threshold first.

        area: least and largest area [px^2] of the mark.
        """
        bounds = (area[0] / sought.times**2, area[1] / sought.times**2)
        for traced, polarity in sought.traced():
            if cv2.countNonZero(traced.mask) < bounds[0]:
                continue
            rough = candidates(traced, self._template, area=bounds, worst=ROUGH, solidity_margin=0.25)
            yield [
                (pose, polarity)
                for one in rough[:MOST_TRIED]
                for pose in self._examined(sought, one.enlarged(sought.times), polarity, area, level)
            ]

    def _examined(
        self, sought: Sought, rough: Candidate, polarity: int, area: tuple[float, float], level: LevelAxes
    ) -> list[MarkPose]:
        """Poses of a rough contour, thresholded again by Otsu in the contour's own surroundings."""
        region, corner = sought.region, sought.corner
        x0, y0, x1, y1 = rough.box
        margin = 4 + (x1 - x0 + y1 - y0) // 8
        x0, y0 = max(x0 - margin, 0), max(y0 - margin, 0)
        patch = np.ascontiguousarray(region[y0 : y1 + margin, x0 : x1 + margin])
        mask = above(patch, otsu(patch), below=polarity < 0)
        sharp = candidates(Traced.of(mask), self._template, area=area, worst=FINE, solidity_margin=0.15)
        if sharp:
            return self._from_moments(sharp[0], (corner[0] + x0, corner[1] + y0), level)
        # uneven light: the first threshold may have been the better
        return self._from_moments(rough, corner, level) if rough.mismatch <= NEAR else []

    def _from_moments(self, candidate: Candidate, corner: tuple[int, int], level: LevelAxes) -> list[MarkPose]:
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
