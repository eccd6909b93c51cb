"""From a clean rendered picture to what a camera delivers: lens, exposure, blur, noise."""

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.cameras import blur, noise
from sim.cameras.blur import Blur
from sim.cameras.exposure import Curve, Exposure
from sim.cameras.noise import Noise
from sim.cameras.optics import Lens

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Imaging:
    """How one camera makes pictures; its lens is in the camera's model."""

    colour: bool = True  # False: a monochrome camera
    exposure: Exposure = field(default_factory=Exposure)
    blur: Blur = field(default_factory=Blur)
    noise: Noise = field(default_factory=Noise)


CLEAN = Imaging(blur=Blur(defocus=0.0, exposure_time=0.0), noise=Noise(0.0, 0.0))  # nothing but geometry and light


def develop(
    picture: Picture,
    imaging: Imaging,
    lens: Lens | None,
    factor: float,
    speed: tuple[float, float],
    rng: np.random.Generator,
) -> Picture:
    """The camera's 8-bit picture (H, W) or (H, W, 3) RGB.

    picture: rendered RGB (or already grey); factor: gain times strength of the light; speed (u, v) [px/s] of the scene
    over the picture.
    """
    if not imaging.colour and picture.ndim == 3:
        picture = np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), np.uint8)
    if lens is not None:
        picture = lens.bend(picture)
    picture = blur.apply(picture, imaging.blur, speed)
    if factor != 1.0:
        picture = np.asarray(cv2.LUT(picture, Curve(factor).table), np.uint8)
    return noise.apply(picture, imaging.noise, rng)
