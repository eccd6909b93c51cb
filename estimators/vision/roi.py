"""The part of a picture in which to look for a mark that has been seen before.

The predicted place of the mark's whole extent, larger by three standard deviations of where its centre may lie in the
picture, 3 sqrt(diag(H P H')), and by what motion may smear it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from estimators.vision.pose import project_with_slopes
from estimators.vision.sighting import PadPrediction
from flightlog.camera import CameraModel

Floats = NDArray[np.float64]
Box = tuple[int, int, int, int]  # left, top, right, bottom [px], right and bottom excluded

DEVIATIONS = 3.0
NEAREST = 0.3  # of the predicted distance: a prediction as vague as that is none
WORTH = 0.8  # of the picture: a larger part saves nothing


def region(camera: CameraModel, prediction: PadPrediction, radius: float, blur: float = 4.0) -> Box | None:
    """Where a mark that reaches `radius` [m] from its centre must lie; None where that is (nearly) anywhere.

    blur [px]: smear, and what the processing needs around the mark.
    """
    centre, std = np.asarray(prediction.position, float), np.asarray(prediction.std_position, float)
    nearest = centre[2] - DEVIATIONS * std[2]
    if not nearest > max(NEAREST * centre[2], radius * 0.5):
        return None
    pixels, slopes = project_with_slopes(camera, centre[None])
    spread = np.sqrt((slopes[0] ** 2) @ std**2)
    # off the axis a disc at this distance looks larger by the slant of its rays
    slant = math.hypot(1.0, float(np.hypot(centre[0], centre[1])) / nearest)
    half = radius / nearest * slant * np.array([camera.fx, camera.fy]) + DEVIATIONS * spread + blur
    size = np.array([camera.width, camera.height])
    low = np.clip(np.floor(pixels[0] - half), 0, size).astype(int)
    high = np.clip(np.ceil(pixels[0] + half) + 1, 0, size).astype(int)
    if np.any(high - low < 8) or np.prod(high - low) > WORTH * np.prod(size):
        return None
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])
