"""Blur: defocus, and motion during the exposure, as one small convolution."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from flightlog.camera import CameraModel

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Blur:
    """What softens the picture; the renderer's texture filter adds its own, about half a pixel."""

    defocus: float = 0.4  # [px] standard deviation of the lens' spot
    exposure_time: float = 0.002  # [s]


def image_motion(
    camera: CameraModel, axes: Floats, position: Floats, velocity: Floats, rates: Floats
) -> tuple[float, float]:
    """Speed (u, v) [px/s] of the scene over the picture's centre.

    axes (3, 3): the camera's axes as columns in the world; position (3,) [m] and velocity (3,) [m/s] of the camera in
    the world; rates (3,) [rad/s] of the camera, in the world. The scene is the plane z = 0, or infinitely far where
    the camera does not look down on it.
    """
    w = axes.T @ rates
    v = axes.T @ velocity
    down = -axes[2, 2]
    closeness = down / max(position[2], 0.05) if down > 0.05 else 0.0
    # a point at (0, 0, Z) in camera axes moves by -v - w x p
    return camera.fx * (-v[0] * closeness - w[1]), camera.fy * (-v[1] * closeness + w[0])


def kernel(defocus: float, motion: tuple[float, float]) -> Floats:
    """Convolution kernel (N, N) of a Gaussian spot [px] drawn out along `motion` [px] during the exposure."""
    length = math.hypot(*motion)
    spot = max(defocus, 0.25)  # a line narrower than this would alias
    half = min(math.ceil(2.5 * spot + length / 2), 15)
    y, x = np.mgrid[-half : half + 1, -half : half + 1].astype(float)
    count = max(1, math.ceil(4 * length))
    share = (np.arange(count) + 0.5) / count - 0.5
    out = np.zeros_like(x)
    for s in share:
        out += np.exp(-((x - s * motion[0]) ** 2 + (y - s * motion[1]) ** 2) / (2 * spot**2))
    return np.asarray(out / out.sum())


def apply(image: NDArray[np.uint8], blur: Blur, speed: tuple[float, float]) -> NDArray[np.uint8]:
    """The blurred picture; `speed` (u, v) [px/s] of the scene over it."""
    motion = (speed[0] * blur.exposure_time, speed[1] * blur.exposure_time)
    # below this a line's variance L^2/12 is under 0.02 px^2: less than the texture filter varies by
    if math.hypot(*motion) < 0.5:
        if blur.defocus < 0.2:
            return image
        return np.asarray(cv2.GaussianBlur(image, (5, 5) if blur.defocus > 0.6 else (3, 3), blur.defocus), np.uint8)
    return np.asarray(cv2.filter2D(image, -1, kernel(blur.defocus, motion)), np.uint8)
