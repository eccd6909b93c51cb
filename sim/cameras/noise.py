"""Shot and read noise, quick and the same in every run.

Drawing a third of a million normal numbers costs more than rendering them. One large tile of them is drawn once from a
fixed seed, and each frame cuts its own window out of it, at an offset that its (flight seed, camera, frame) decides.
"""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

ROOM = 509  # [texels] by which the tile exceeds the picture either way: 259,000 different windows
SCALE = 32  # tile units to one standard deviation; it is clipped at 4 (1 in 16,000)
FINE = 16  # sigma steps to one grey level


@dataclass(frozen=True)
class Noise:
    """Variance [level^2] = read^2 + shot^2 * level / 255."""

    read: float = 1.2  # [grey level] standard deviation in the dark
    shot: float = 2.2  # [grey level] standard deviation of shot noise alone at level 255

    def sigma(self) -> NDArray[np.int16]:
        """Standard deviation (256,) [1/FINE levels] at each level."""
        level = np.arange(256)
        return np.rint(FINE * np.sqrt(self.read**2 + self.shot**2 * level / 255.0)).astype(np.int16)


@cache
def _tile(height: int, width: int) -> NDArray[np.int8]:
    rng = np.random.default_rng(20190826)
    values = rng.standard_normal((height + ROOM, width + ROOM), dtype=np.float32) * SCALE
    return np.clip(np.rint(values), -127, 127).astype(np.int8)


@cache
def _table(noise: Noise) -> NDArray[np.int16]:
    return noise.sigma()


def apply(image: NDArray[np.uint8], noise: Noise, rng: np.random.Generator) -> NDArray[np.uint8]:
    """The picture (H, W) or (H, W, C) with noise, independent for each pixel and channel, rounded and clipped."""
    if noise.read == 0.0 and noise.shot == 0.0:
        return image
    flat = image.reshape(image.shape[0], -1)
    height, width = flat.shape
    row, column = rng.integers(0, ROOM, 2)
    window = _tile(height, width)[row : row + height, column : column + width]
    spread = np.asarray(cv2.LUT(flat, _table(noise)), np.int16)
    spread *= window
    spread += SCALE * FINE // 2  # rounding before the shift
    spread >>= (SCALE * FINE).bit_length() - 1
    spread += flat
    return np.asarray(cv2.convertScaleAbs(np.maximum(spread, 0, out=spread)), np.uint8).reshape(image.shape)
