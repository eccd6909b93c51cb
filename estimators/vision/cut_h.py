"""Starts for an H that the picture's edge cuts."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from estimators.vision.blur_fit import Look
from estimators.vision.level_sets import Blob
from estimators.vision.pose import LevelAxes
from flightlog.camera import CameraModel
from flightlog.marks import HMark

Floats = NDArray[np.float64]


def cut_starts(blob: Blob, camera: CameraModel, level: LevelAxes, usual: HMark, spread: Floats) -> Iterator[Look]:
    """Poses of an H that would show what the blob shows."""
    return iter(())
