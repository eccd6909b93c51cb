"""The pinhole camera with its lens, as both the renderer and the vision see it.

Camera axes: x right, y down, z along the optical axis. Pixel centres lie at integers, so a centred principal
point is ((W-1)/2, (H-1)/2). fx and fy differ where pixels are not square.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]

# OpenCV stops after five iterations, which leaves pixels at the corners of a strong lens
UNDISTORT = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-9)
# columns: the camera's x, y, z axes in body axes; it looks along body -z, image up is forward
DOWN = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
# it looks along body x, image up is body up
FORWARD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class CameraModel:
    """Intrinsics of one camera; `distortion` is k1, k2, p1, p2, k3 of OpenCV's model."""

    width: int  # [px]
    height: int  # [px]
    fx: float  # [px]
    fy: float  # [px]
    cx: float  # [px] principal point
    cy: float  # [px]
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @classmethod
    def centred(cls, width: int, height: int, fx: float, fy: float | None = None) -> "CameraModel":
        """A camera without distortion whose principal point is the picture's centre; square pixels without `fy`."""
        return cls(width, height, fx, fx if fy is None else fy, (width - 1) / 2, (height - 1) / 2)

    @cached_property
    def matrix(self) -> Floats:
        """K (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def distorted(self) -> bool:
        """Whether the lens bends straight lines."""
        return any(self.distortion)

    def project(self, points: Floats) -> Floats:
        """Pixels (N, 2) of points (N, 3) [m] in camera axes; NaN for points behind the camera."""
        points = np.asarray(points, float).reshape(-1, 3)
        depth = points[:, 2]
        ahead = depth > 1e-9
        safe = np.where(ahead[:, None], points, [0.0, 0.0, 1.0])
        if self.distorted:
            pixels, _ = cv2.projectPoints(safe, np.zeros(3), np.zeros(3), self.matrix, np.array(self.distortion))
            pixels = pixels.reshape(-1, 2)
        else:
            pixels = safe[:, :2] / safe[:, 2:] * [self.fx, self.fy] + [self.cx, self.cy]
        return np.where(ahead[:, None], pixels, np.nan)

    def rays(self, pixels: Floats) -> Floats:
        """Directions (N, 3) with z = 1 in camera axes of pixels (N, 2): the lens taken out."""
        pixels = np.asarray(pixels, float).reshape(-1, 2)
        if self.distorted:
            flat = cv2.undistortPoints(
                pixels.reshape(-1, 1, 2), self.matrix, np.array(self.distortion), criteria=UNDISTORT
            ).reshape(-1, 2)
        else:
            flat = (pixels - [self.cx, self.cy]) / [self.fx, self.fy]
        return np.column_stack([flat, np.ones(len(flat))])

    def contains(self, pixels: Floats, margin: float = 0.0) -> NDArray[np.bool_]:
        """Which of the pixels (N, 2) lie in the picture, `margin` [px] away from its edge."""
        pixels = np.asarray(pixels, float).reshape(-1, 2)
        upper = np.array([self.width - 1, self.height - 1]) - margin
        with np.errstate(invalid="ignore"):
            return np.asarray(np.all((pixels >= margin) & (pixels <= upper), axis=1))


@dataclass(frozen=True, eq=False)
class CameraMount:
    """Where a camera sits aboard."""

    position: Floats  # (3,) [m] body axes
    axes: Floats  # (3, 3) columns: the camera's x, y, z in body axes

    @classmethod
    def downward(cls, position: Floats) -> "CameraMount":
        """Along body -z, image up is forward."""
        return cls(np.asarray(position, float), DOWN)

    @classmethod
    def forward(cls, position: Floats, nose_down: float = 0.0) -> "CameraMount":
        """Along body x, turned `nose_down` [rad] about the body's y axis."""
        c, s = math.cos(nose_down), math.sin(nose_down)
        # a turn about y left by +a takes x to (cos a, 0, -sin a): nose down
        turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        return cls(np.asarray(position, float), turn @ FORWARD)

    def turned(self, roll: float, pitch: float) -> "CameraMount":
        """The same place, the camera turned with a body that rolled right side down and pitched nose up [rad]."""
        return CameraMount(self.position, Rotation.from_rotvec([roll, -pitch, 0.0]).as_matrix() @ self.axes)
