"""Pose of a flat, level mark seen by a camera whose tilt is known: geometry only.

Four unknowns: the mark's centre in camera axes and the angle of its axis. The pad is horizontal in the world, so the
attitude gives its normal; image up, projected on the horizontal, is the zero of the angle.
"""

import math
from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from flightlog.camera import CameraModel, CameraMount
from flightlog.rotations import matrix

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LevelAxes:
    """Horizontal directions of the world that share the camera's heading, in camera axes."""

    right: Floats  # (3,)
    forward: Floats  # (3,) horizontal projection of image up
    up: Floats  # (3,)

    def turned(self, tilt: Floats) -> "LevelAxes":
        """The same turned by a rotation vector `tilt` (3,) [rad] in camera axes."""
        rotation, _ = cv2.Rodrigues(np.asarray(tilt, float))
        return LevelAxes(rotation @ self.right, rotation @ self.forward, rotation @ self.up)


@dataclass(frozen=True, eq=False)
class MarkPose:
    """Centre of the mark in camera axes and angle of its axis, clockwise from level forward."""

    position: Floats  # (3,) [m]
    angle: float  # [rad]


def level_axes(attitude: Floats, mount: CameraMount) -> LevelAxes:
    """Level axes of a camera, from the vehicle's `attitude` (4,) wxyz, body to world."""
    world_from_camera = matrix(np.asarray(attitude, float)) @ mount.axes
    image_up = -world_from_camera[:, 1]
    forward = np.array([image_up[0], image_up[1], 0.0])
    length = math.hypot(forward[0], forward[1])
    if length < 1e-6:
        raise ValueError("camera: image up is vertical, the mark's angle has no zero")
    forward /= length
    right = np.array([forward[1], -forward[0], 0.0])
    return LevelAxes(
        world_from_camera.T @ right, world_from_camera.T @ forward, world_from_camera.T @ np.array([0.0, 0.0, 1.0])
    )


def directions(pose: MarkPose, level: LevelAxes) -> tuple[Floats, Floats]:
    """The mark's x (right) and y (its axis) directions, each (3,) in camera axes."""
    c, s = math.cos(pose.angle), math.sin(pose.angle)
    return c * level.right - s * level.forward, c * level.forward + s * level.right


def place(points: Floats, pose: MarkPose, level: LevelAxes) -> Floats:
    """Points (N, 2) [m] of the mark's plane, mark axes, in camera axes (N, 3)."""
    x, y = directions(pose, level)
    return np.asarray(pose.position + points[:, :1] * x + points[:, 1:] * y)


def project_with_slopes(camera: CameraModel, points: Floats) -> tuple[Floats, Floats]:
    """Pixels (N, 2) of points (N, 3) in camera axes, and their derivatives (N, 2, 3) [px/m]; all need z > 0."""
    if not camera.distorted:
        return _pinhole(np.ascontiguousarray(points), camera.fx, camera.fy, camera.cx, camera.cy)  # type: ignore[no-any-return]
    pixels, slopes = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion))
    # columns 3 to 5 are the derivatives by the translation, hence by the point
    derivatives = np.ascontiguousarray(slopes[:, 3:6], float).reshape(-1, 2, 3)
    return np.asarray(pixels, float).reshape(-1, 2), derivatives


@numba.njit(cache=True)
def _pinhole(points, fx, fy, cx, cy):
    """`project_with_slopes` without a lens: some twenty times as fast as OpenCV's."""
    n = len(points)
    pixels, slopes = np.empty((n, 2)), np.zeros((n, 2, 3))
    for i in range(n):
        inverse = 1.0 / points[i, 2]
        x, y = points[i, 0] * inverse, points[i, 1] * inverse
        pixels[i, 0], pixels[i, 1] = fx * x + cx, fy * y + cy
        slopes[i, 0, 0], slopes[i, 0, 2] = fx * inverse, -fx * x * inverse
        slopes[i, 1, 1], slopes[i, 1, 2] = fy * inverse, -fy * y * inverse
    return pixels, slopes


def on_pad_plane(pixels: Floats, camera: CameraModel, level: LevelAxes) -> Floats:
    """Where the rays of pixels (N, 2) meet a level plane one unit below the camera: (N, 2) right, forward.

    NaN for rays that do not go down.
    """
    rays = camera.rays(pixels)
    down = -rays @ level.up
    down = np.where(down > 1e-3, down, np.nan)
    return np.column_stack([rays @ level.right / down, rays @ level.forward / down])


def from_pad_plane(right: float, forward: float, height: float, level: LevelAxes) -> Floats:
    """Camera axes (3,) [m] of a point on the pad's plane `height` [m] below, offsets per unit of height."""
    return np.asarray(height * (right * level.right + forward * level.forward - level.up))


def wrap_axis(angle: float) -> float:
    """The angle [rad] of an axis without direction, in (-pi/2, pi/2]."""
    return math.pi / 2 - (math.pi / 2 - angle) % math.pi
