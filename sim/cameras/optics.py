"""Lens distortion: a wider pinhole picture is rendered and bent by a fixed map."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from flightlog.camera import CameraModel

BORDER = 4  # [px] kept around, for interpolation


def _border(camera: CameraModel) -> NDArray[np.float64]:
    """The pixels (N, 2) around the picture's edge."""
    x, y = np.arange(camera.width), np.arange(camera.height)
    top, left = np.stack([x, 0 * x], 1), np.stack([0 * y, y], 1)
    edge = np.vstack([top, top + [0, camera.height - 1], left, left + [camera.width - 1, 0]])
    return np.asarray(edge, float)


def pinhole_behind(camera: CameraModel) -> CameraModel:
    """The pinhole camera that sees all that `camera` sees: itself where its lens does not bend.

    It keeps the focal lengths, so that the centre is sampled as finely as the final picture.
    """
    if not camera.distorted:
        return camera
    edge = _border(camera)
    rays = camera.rays(edge)
    pixels = rays[:, :2] * [camera.fx, camera.fy]
    low, high = pixels.min(0), pixels.max(0)
    inverted = bool(np.all(np.abs(camera.project(rays) - edge) < 0.05))
    if not inverted or np.any(high - low > 4.0 * np.array([camera.width, camera.height])):
        raise ValueError(f"lens distortion {camera.distortion} cannot be inverted over the picture")
    left, up = (math.ceil(-v) + BORDER for v in low)
    width, height = (math.ceil(v) + BORDER for v in high)
    return CameraModel(left + width + 1, up + height + 1, camera.fx, camera.fy, float(left), float(up))


@dataclass(frozen=True, eq=False)
class Lens:
    """The map from a camera's pixels to those of the pinhole picture behind it."""

    coarse: NDArray[np.int16]  # (H, W, 2)
    fine: NDArray[np.uint16]  # (H, W)

    @classmethod
    def of(cls, camera: CameraModel) -> "Lens | None":
        """None where the lens does not bend."""
        if not camera.distorted:
            return None
        y, x = np.mgrid[: camera.height, : camera.width]
        behind = pinhole_behind(camera)
        pixels = behind.project(camera.rays(np.stack([x, y], -1).reshape(-1, 2).astype(float)))
        maps = pixels.reshape(camera.height, camera.width, 2).astype(np.float32)
        coarse, fine = cv2.convertMaps(maps[..., 0], maps[..., 1], cv2.CV_16SC2)
        return cls(coarse.astype(np.int16), fine.astype(np.uint16))

    def bend(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The picture (H, W) or (H, W, 3) as the lens forms it."""
        return np.asarray(cv2.remap(image, self.coarse, self.fine, cv2.INTER_LINEAR), np.uint8)
