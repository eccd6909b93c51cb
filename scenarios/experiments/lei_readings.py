"""All readings of Lei 2012's equation 7 side by side on the same contours."""

from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimators.vision.lei_height import Form, HeightReading, Length, Pixels, height
from estimators.vision.lei_mark import LeiFrontEnd
from estimators.vision.pose import level_axes
from estimators.vision.sighting import PadPrediction
from flightlog.rotations import angles

Floats = NDArray[np.float64]

LENGTHS: tuple[Length, ...] = ("side", "perimeter", "root_area")
FORMS: tuple[tuple[Pixels, Form], ...] = (("raw", "printed"), ("calibrated", "printed"), ("calibrated", "exact"))
READINGS = [HeightReading(length, *form) for length, form in product(LENGTHS, FORMS)]
PUBLISHED = READINGS.index(HeightReading())  # side of the smallest rectangle, pixels taken for square, equation 7


def heights(
    front_end: LeiFrontEnd, image: NDArray[np.uint8], attitude: Floats, prediction: PadPrediction | None = None
) -> Floats:
    """Heights [m] of the camera by each of READINGS, from one picture (H, W); NaN where the mark is not found."""
    found = front_end.find(image, prediction)
    if found is None:
        return np.full(len(READINGS), np.nan)
    contour, level = found[0].contour.astype(float), level_axes(attitude, front_end.mount)
    roll, pitch, _ = angles(attitude)
    outline = front_end.mark.outline()
    return np.array([height(contour, outline, front_end.camera, level, (roll, pitch), each) for each in READINGS])


def table(errors: Floats, unit: float, name: str, further: Iterable[dict[str, Any]] = ()) -> list[dict[str, Any]]:
    """Mean, largest and deviation of errors (N, readings) [m], in units of `unit` [m] called `name`."""
    rows: list[dict[str, Any]] = [
        {
            "length": reading.length,
            "pixels": "on the level plane" if reading.form == "exact" else reading.pixels,
            f"mean |error| [{name}]": round(float(np.nanmean(np.abs(column))) / unit, 3),
            f"largest [{name}]": round(float(np.nanmax(np.abs(column))) / unit, 3),
            f"deviation [{name}]": round(float(np.nanstd(column)) / unit, 3),
        }
        for reading, column in zip(READINGS, errors.T, strict=True)
    ]
    for row, more in zip(rows, further, strict=False):
        row |= more
    return rows
