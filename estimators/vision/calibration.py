"""A camera's intrinsics from pictures of a chessboard (Wu 2019, section 2.1; Zhang 2000, as OpenCV has it)."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from flightlog.camera import CameraModel

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

LEAST_PICTURES = 5


@dataclass(frozen=True)
class Chessboard:
    """A board by its inner corners."""

    columns: int = 9
    rows: int = 6
    square: float = 0.10  # [m]

    def corners(self) -> Floats:
        """Inner corners (columns * rows, 3) [m] in the board's plane, row by row."""
        x, y = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        return np.asarray(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) * self.square, float)


@dataclass(frozen=True, eq=False)
class Calibration:
    """What the pictures say of the camera."""

    camera: CameraModel
    std: Floats  # (9,) of fx, fy, cx, cy [px], k1, k2, p1, p2, k3; 0 for what was held
    residual: float  # [px] RMS distance of the corners from where they should be
    pictures: int  # in which the board was found


def find_board(image: Image, board: Chessboard) -> Floats | None:
    """Inner corners (N, 2) [px] of the board in a picture (H, W) or (H, W, 3) RGB, in its order; None without it."""
    grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8) if image.ndim == 3 else image
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    found, corners = cv2.findChessboardCornersSB(grey, (board.columns, board.rows), flags=flags)
    return np.asarray(corners, float).reshape(-1, 2) if found else None


def calibrate(
    sightings: Sequence[Floats], board: Chessboard, width: int, height: int, *, third_radial: bool = False
) -> Calibration:
    """The camera from the corners (N, 2) [px] seen in each of some pictures of width x height pixels.

    third_radial: k3 too, which only a wide lens shows.

    Raises:
        ValueError: fewer than five pictures show the board.
    """
    if len(sightings) < LEAST_PICTURES:
        raise ValueError(f"calibration: {len(sightings)} pictures show the board; at least {LEAST_PICTURES} are needed")
    model = board.corners().astype(np.float32)
    flags = 0 if third_radial else cv2.CALIB_FIX_K3
    residual, matrix, distortion, _, _, deviations, _, _ = cv2.calibrateCameraExtended(
        [model] * len(sightings), [s.astype(np.float32) for s in sightings], (width, height), np.eye(3), np.zeros(5),
        flags=flags,
    )  # fmt: skip
    k = [float(value) for value in np.ravel(distortion)[:5]]
    camera = CameraModel(
        width, height, float(matrix[0, 0]), float(matrix[1, 1]), float(matrix[0, 2]), float(matrix[1, 2]),
        (k[0], k[1], k[2], k[3], k[4]),
    )  # fmt: skip
    return Calibration(camera, np.ravel(deviations)[:9].astype(float), float(residual), len(sightings))
