"""The H as Lei et al. 2012 see it: modified Otsu, median, Canny, affine moments, height by equation 7 (section 2.2).

Sideways, the paper has nothing: the contour's centroid and its second moments give place and angle.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.contours import ShapeTemplate
from estimators.vision.lei_height import HeightReading, focal, height, length
from estimators.vision.lei_match import Edges, Invariants, Match, match
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
from estimators.vision.threshold import above, modified_otsu, otsu
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import HMark
from flightlog.rotations import angles

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

Threshold = Literal["printed", "open", "otsu"]
Region = Literal["whole", "predicted"]

LENGTH_STD = 1.65  # [px] of the contour's length: on the stairs' four heights that is the paper's 0.351 m
SMALLEST_SIDE = 30.0  # [px]
LARGEST_SHARE = 0.6  # of the picture
AREA_RANGE = (0.7, 1.5)  # of the area that the predicted height means
MARGIN = 0.75  # [sides] of the predicted region around the mark's centre
LEAST_CONTRAST = 8.0  # [grey levels]


@dataclass(frozen=True)
class LeiReading:
    """One reading of what the paper leaves open before the height.

    `thresholds` are tried in their order until a contour matches by `good`, else the best match of all counts. The
    printed one alone loses a mark that is small in the picture or stands before a noisy ground; in a region it holds
    further, and plain Otsu does what is left.
    """

    thresholds: tuple[Threshold, ...] = ("printed", "open", "otsu")
    region: Region = "predicted"  # predicted: where there is a prediction; whole: always the whole picture
    median: Literal[1, 3, 5] = 3  # [px] side of equation 1's window
    edges: Edges = "canny"
    invariants: Invariants = "extended"  # I6 and I7 as well: I2 and I3 of an H are nothing but noise
    good: float = 0.3  # value of equation 4 with which no other threshold is tried
    worst: float = 0.8  # largest value of equation 4
    height: HeightReading = field(default_factory=HeightReading)


def stands_out(grey: Image, contour: NDArray[np.int32]) -> float:
    """Mean grey level inside a contour (N, 2) less that of the rest of the box around it."""
    x, y, w, h = cv2.boundingRect(contour)
    inside = np.zeros((h, w), np.uint8)
    cv2.drawContours(inside, [contour.reshape(-1, 1, 2)], -1, 255, cv2.FILLED, offset=(-x, -y))
    box = grey[y : y + h, x : x + w]
    return float(cv2.mean(box, inside)[0] - cv2.mean(box, cv2.bitwise_not(inside))[0])


class LeiFrontEnd:
    """Looks for one H in the pictures of one camera. Keeps nothing from one picture to the next."""

    def __init__(
        self, camera: CameraModel, mount: CameraMount, mark: HMark, reading: LeiReading | None = None
    ) -> None:
        """With the readings that are the most plausible, unless told otherwise."""
        self.camera, self.mount, self.mark, self.reading = camera, mount, mark, reading or LeiReading()
        self._outline = mark.outline()
        self._template = ShapeTemplate.of(self._outline)
        moments = cv2.moments(self._outline.astype(np.float32))
        self._area = moments["m00"]  # [m^2]
        self._raggedness = length(self._outline, "perimeter") / math.sqrt(self._area)
        self._lengthwise = moments["mu02"] / moments["mu20"]
        self._size = max(mark.leg, mark.width)

    def see(self, image: Image, attitude: Floats, prediction: PadPrediction | None = None) -> PadSighting | None:
        """The mark in a picture (H, W) uint8, or (H, W, 3) RGB which is made grey; None unless all of it is seen.

        attitude: (4,) wxyz, body to world. The stated height error is `LENGTH_STD` pixels of the contour's length,
        which on the stairs' heights is the paper's own standard deviation.
        """
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8) if image.ndim == 3 else image
        if grey.shape != (self.camera.height, self.camera.width):
            raise ValueError(
                f"picture: {grey.shape[1]}x{grey.shape[0]}, the camera has {self.camera.width}x{self.camera.height}"
            )
        found = self.find(grey, prediction)
        if found is None:
            return None
        matched, contrast = found
        level = level_axes(attitude, self.mount)
        contour = matched.contour.astype(float)
        roll, pitch, _ = angles(attitude)
        above_mark = height(contour, self._outline, self.camera, level, (roll, pitch), self.reading.height)
        flat = on_pad_plane(contour, self.camera, level)
        if not (math.isfinite(above_mark) and np.all(np.isfinite(flat))):
            return None
        return self._sighting(matched, contrast, above_mark, flat, level, tracked=prediction is not None)

    def find(self, grey: Image, prediction: PadPrediction | None = None) -> tuple[Match, float] | None:
        """The mark's contour in a grey picture (H, W), in its pixels, and how far it stands out [grey levels]."""
        left, top, right, bottom = self._region(prediction)
        if min(right - left, bottom - top) < SMALLEST_SIDE:
            return None
        region = np.ascontiguousarray(grey[top:bottom, left:right])
        best: tuple[Match, float] | None = None
        for kind in self.reading.thresholds:
            level = otsu(region) if kind == "otsu" else modified_otsu(region, kind)
            if level is None:
                continue
            mask = np.asarray(cv2.medianBlur(above(region, level), self.reading.median), np.uint8)
            matched = match(
                mask, self._template, raggedness=self._raggedness, area=self._area_bounds(prediction),
                worst=self.reading.worst, edges=self.reading.edges, invariants=self.reading.invariants,
            )  # fmt: skip
            if matched is None or (best is not None and matched.value >= best[0].value):
                continue
            contrast = stands_out(region, matched.contour)
            if contrast < LEAST_CONTRAST:
                continue
            best = Match(matched.contour + np.array([left, top], np.int32), matched.value, matched.area), contrast
            if matched.value <= self.reading.good:
                break
        return best

    def _region(self, prediction: PadPrediction | None) -> tuple[int, int, int, int]:
        """Left, top, right, bottom [px], right and bottom excluded."""
        camera = self.camera
        if self.reading.region == "whole" or prediction is None or prediction.position[2] <= 0.0:
            return 0, 0, camera.width, camera.height
        depth, std = prediction.position[2], prediction.std_position
        nearest = max(depth - 3.0 * std[2], 0.3 * depth)
        centre = camera.project(prediction.position)[0]
        half = np.array([camera.fx, camera.fy]) * (MARGIN * self._size + 3.0 * std[:2]) / nearest
        low = np.clip(centre - half, 0, [camera.width, camera.height]).astype(int)
        high = np.clip(centre + half + 1.0, 0, [camera.width, camera.height]).astype(int)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    def _area_bounds(self, prediction: PadPrediction | None) -> tuple[float, float]:
        """Least and largest area [px^2] of the mark."""
        least = self._area / self._size**2 * SMALLEST_SIDE**2
        largest = LARGEST_SHARE * self.camera.width * self.camera.height
        if prediction is None or prediction.position[2] <= 0.0:
            return least, largest
        depth, std = prediction.position[2], prediction.std_position[2]
        scale = self._area * self.camera.fx * self.camera.fy
        low, high = AREA_RANGE
        return (
            max(least, low * scale / (depth + 3.0 * std) ** 2),
            min(largest, high * scale / max(depth - 3.0 * std, 0.3 * depth) ** 2),
        )

    def _sighting(
        self, matched: Match, contrast: float, above_mark: float, flat: Floats, level: LevelAxes, *, tracked: bool
    ) -> PadSighting:
        moments = cv2.moments(np.ascontiguousarray(flat, np.float32).reshape(-1, 1, 2))
        right, forward = moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]
        position = from_pad_plane(right, forward, above_mark, level)
        longest = 0.5 * math.atan2(2.0 * moments["mu11"], moments["mu20"] - moments["mu02"])
        # the H's second moment is larger across its axis, unless its legs are long
        angle = wrap_axis(-longest if self._lengthwise < 1.0 else math.pi / 2 - longest)
        corners = self.camera.project(place(self._outline, MarkPose(position, angle), level))
        points = matched.contour[:: max(1, len(matched.contour) // 200)].astype(np.float32)
        rim = corners.astype(np.float32).reshape(-1, 1, 2)
        away = [cv2.pointPolygonTest(rim, (float(u), float(v)), True) for u, v in points]
        f = focal(self.camera)
        std_height = LENGTH_STD * above_mark**2 / (f * self._size)
        std_side = 0.5 * LENGTH_STD * above_mark / f
        std_angle = LENGTH_STD * above_mark / (f * self._size)
        ray = position / position[2]
        along = np.append(std_height * ray, 0.0)
        covariance = np.outer(along, along) + np.diag([std_side**2, std_side**2, 0.0, std_angle**2])
        std = np.sqrt(np.diag(covariance))
        return PadSighting(
            position=position,
            angle=angle,
            std_position=std[:3],
            std_angle=float(std[3]),
            covariance=covariance,
            quality=float(max(0.0, 1.0 - matched.value / self.reading.worst)),
            visible=1.0,
            outline=corners,
            source="tracked" if tracked else "acquired",
            up=level.up,
            residual=float(np.sqrt(np.mean(np.square(away)))),
            contrast=contrast,
        )
