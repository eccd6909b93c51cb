"""Height from the length of a matched contour: equations 5 to 7 of Lei 2012 in the readings that they leave open.

    f/h = l/L (5),   h = f L/l (6),   h = (f L/l) cos(theta) cos(phi) (7)

"l is the length of the matched contour in pixels, L its physical length". Open is which length (the perimeter, the
side of the smallest rectangle around it, or the root of its area), and what f is for pixels that are not square.

Equation 7 holds for a mark on the optical axis. A vehicle that hovers above the mark with a tilt has it off the axis,
where the sign of the correction is the other way round: 0.22 m at 10 m with 7.2 and 4.6 deg. The exact form measures
the contour where its rays meet the level plane one unit below the camera; equation 6 with f = 1 is then right for any
tilt and place in the picture.
"""

import math
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.pose import LevelAxes, on_pad_plane
from flightlog.camera import CameraModel

Floats = NDArray[np.float64]

Length = Literal["side", "perimeter", "root_area"]
Pixels = Literal["raw", "calibrated"]
Form = Literal["printed", "exact"]


@dataclass(frozen=True)
class HeightReading:
    """One reading of equations 5 to 7."""

    length: Length = "side"  # the pad is quoted as "1 m x 1 m", the desk's as "20 cm x 20 cm"
    pixels: Pixels = "raw"  # raw: one f whatever the pixel's shape, the root of fx fy; calibrated: fx and fy
    form: Form = "printed"  # printed: equation 7; exact: on the level plane, always with fx, fy and the lens
    focal_factor: float = 1.0  # what a calibration at one known distance has multiplied f by


def length(contour: Floats, kind: Length) -> float:
    """Length of a closed contour (N, 2), in its own unit."""
    points = np.ascontiguousarray(contour, np.float32).reshape(-1, 1, 2)
    if kind == "perimeter":
        return float(cv2.arcLength(points, True))
    if kind == "root_area":
        return math.sqrt(cv2.contourArea(points))
    width, height = cv2.minAreaRect(points)[1]
    return 0.5 * (width + height)


def focal(camera: CameraModel) -> float:
    """The one focal length [px] of equation 5 for pixels as they are."""
    return math.sqrt(camera.fx * camera.fy)


def height(
    contour: Floats, outline: Floats, camera: CameraModel, level: LevelAxes, tilt: tuple[float, float],
    reading: HeightReading,
) -> float:  # fmt: skip
    """Height of the camera above the mark [m]; NaN where there is no length.

    contour (N, 2) [px]; outline (M, 2) [m] of the mark; tilt: roll and pitch [rad].
    """
    if reading.form == "exact":
        flat, f, lean = on_pad_plane(contour, camera, level), 1.0, 1.0
        if not np.all(np.isfinite(flat)):
            return math.nan
    else:
        lean = math.cos(tilt[0]) * math.cos(tilt[1])
        if reading.pixels == "calibrated":
            flat, f = camera.rays(contour)[:, :2], 1.0
        else:
            flat, f = contour, focal(camera)
    seen = length(flat, reading.length)
    if seen <= 0.0:
        return math.nan
    return reading.focal_factor * f * length(outline, reading.length) / seen * lean
