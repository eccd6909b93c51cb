"""Wu 2019's front end: the ring landmark's position and heading by equations 1 to 6, misprints corrected.

Roll and pitch are taken for zero, as in section 3.1; `exact` turns the rays level with the attitude first, after which
the same equations hold. With u, v on the level plane one unit below the camera (eq 4),

    h = |P1 P2| / |I1 I2|                       (eq 5)  P1, P2 the two corners farthest apart of those found
    Tx = h (u - u0)/ax,  Ty = h (v - v0)/ay     (eq 6)  of the centre of the circle through the outermost ring's contour

and the heading is that of the Ts' corners about the ring's centre. Where the Ts have left the picture the diameter of
the outermost ring in it takes the place of P1 P2, and there is no heading.
"""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.pose import LevelAxes, MarkPose, from_pad_plane, level_axes, on_pad_plane, place
from estimators.vision.roi import region
from estimators.vision.sighting import PadPrediction, PadSighting
from estimators.vision.wu_features import RingFeatures, find_features
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import RingMark

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
CONTOUR_STD, CORNER_STD = 0.3, 0.7  # [px] of a whole contour's place; of one corner, whole pixels and Harris' bias


class WuFrontEnd:
    """Looks for one ring landmark. Keeps nothing from one picture to the next."""

    def __init__(
        self, camera: CameraModel, mount: CameraMount, mark: RingMark, *, exact: bool = False, roi: bool = False
    ) -> None:
        """exact: use the attitude; roi: look only where the prediction has the mark, and everywhere if it is not there.

        Neither is in the paper; the second is the refuelling paper's.
        """
        self.camera, self.mount, self.mark, self.exact, self.roi = camera, mount, mark, exact, roi
        self._level = level_axes(UPRIGHT, mount)
        self._corners = mark.t_corners()
        self._reach = float(np.hypot(*self._corners.T).max())

    def see(self, image: Image, attitude: Floats, prediction: PadPrediction | None = None) -> PadSighting | None:
        """The mark in a picture (H, W) uint8, or (H, W, 3) RGB which is made grey; None unless a whole ring is seen.

        The angle is NaN where fewer than six of the Ts' corners are found.
        """
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8) if image.ndim == 3 else image
        level = level_axes(attitude, self.mount) if self.exact else self._level
        box = region(self.camera, prediction, self._reach) if self.roi and prediction is not None else None
        if box is not None:
            x0, y0, x1, y1 = box
            seen = self._look(np.ascontiguousarray(grey[y0:y1, x0:x1]), (x0, y0), level, "tracked")
            if seen is not None:
                return seen
        return self._look(grey, (0, 0), level, "acquired")

    def _look(self, grey: Image, corner: tuple[int, int], level: LevelAxes, source: str) -> PadSighting | None:
        features = find_features(grey, corner, lambda pixels: on_pad_plane(pixels, self.camera, level), self.mark)
        return None if features is None else self._sighting(features, level, source)

    def _sighting(self, features: RingFeatures, level: LevelAxes, source: str) -> PadSighting | None:
        circle = features.circle
        plane = on_pad_plane(features.corners, self.camera, level)
        found = np.isfinite(plane[:, 0])
        angle, length, apart = math.nan, 2.0 * features.radius, 2.0 * circle.radius
        std_length = CONTOUR_STD
        if found.any():
            model, seen = self._corners[found], plane[found] - circle.centre
            cross = float(np.sum(model[:, 1] * seen[:, 0] - model[:, 0] * seen[:, 1]))
            angle = math.atan2(cross, float(np.sum(model * seen)))
            between = np.linalg.norm(model[:, None] - model, axis=2)
            first, second = np.unravel_index(int(np.argmax(between)), between.shape)
            length, apart = float(between[first, second]), float(np.linalg.norm(seen[first] - seen[second]))
            std_length = math.sqrt(2.0) * CORNER_STD
        if not apart > 0.0:
            return None
        height = length / apart
        position = from_pad_plane(float(circle.centre[0]), float(circle.centre[1]), height, level)
        pixel = height / np.array([self.camera.fx, self.camera.fy])
        std_height = height * std_length * float(pixel.max()) / length
        arm = np.array([position[0] / position[2], position[1] / position[2], 1.0]) * std_height
        covariance = np.zeros((4, 4))
        covariance[:3, :3] = np.outer(arm, arm) + np.diag([*(CONTOUR_STD * pixel) ** 2, 0.0])
        share = found.mean()
        std_angle = math.nan
        if found.any():
            std_angle = CORNER_STD * float(pixel.max()) / math.sqrt(float(np.sum(self._corners[found] ** 2)))
            covariance[3, 3] = std_angle**2
        std = np.sqrt(np.diag(covariance))
        pose = MarkPose(position, angle if math.isfinite(angle) else 0.0)
        shown = self.camera.project(place(self.mark.outline(), pose, level))
        return PadSighting(
            position=position,
            angle=angle,
            std_position=std[:3],
            std_angle=std_angle,
            covariance=covariance,
            quality=float(0.5 + 0.5 * share),
            visible=float(np.mean(self.camera.contains(shown))),
            outline=shown,
            source="tracked" if source == "tracked" else "acquired",
            up=level.up,
            residual=circle.residual * self.camera.fx,
            contrast=math.nan,
        )
