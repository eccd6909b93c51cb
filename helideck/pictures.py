"""Pictures of the user's own: read from files, with the camera that took them."""

import math
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from flightlog.camera import CameraModel
from flightlog.errors import UserError

Image = NDArray[np.uint8]


class PictureError(UserError):
    """A picture that cannot be read; others may."""


def read_grey(path: Path) -> Image:
    """The picture (H, W) of a file; colours are made grey. Raises PictureError where there is none."""
    return _read(path, cv2.IMREAD_GRAYSCALE)


def read_colour(path: Path) -> Image:
    """The picture (H, W, 3) RGB of a file. Raises PictureError where there is none."""
    return np.asarray(cv2.cvtColor(_read(path, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB), np.uint8)


def camera_of(
    image: Image,
    fx: float,
    fy: float | None = None,
    cx: float | None = None,
    cy: float | None = None,
    distortion: str | None = None,
) -> CameraModel:
    """The camera that took a picture (H, W[, 3]): pixels as square and principal point as central as nobody says else.

    distortion: "k1,k2,p1,p2,k3" of OpenCV's model, the last ones may be left out. Raises UserError for numbers that
    are no camera's.
    """
    height, width = image.shape[:2]
    for name, value in (("--fx", fx), ("--fy", fy)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise UserError(f"{name} {value}: a focal length is a positive number of pixels")
    for name, value, size in (("--cx", cx, width), ("--cy", cy, height)):
        if value is not None and not -size <= value <= 2 * size:
            raise UserError(f"{name} {value}: lies far outside the picture, which is {width}x{height}")
    camera = CameraModel(
        width, height, fx, fx if fy is None else fy, (width - 1) / 2 if cx is None else cx,
        (height - 1) / 2 if cy is None else cy, (0.0,) * 5 if distortion is None else parse_distortion(distortion),
    )  # fmt: skip
    corners = np.array([(0.0, 0.0), (width - 1.0, 0.0), (0.0, height - 1.0), (width - 1.0, height - 1.0)])
    if camera.distorted:
        with np.errstate(all="ignore"):
            back = camera.project(camera.rays(corners))
        if not np.all(np.abs(back - corners) < 1.0):
            raise UserError(f"--dist {distortion}: bends the picture's corners so far that it cannot be undone")
    return camera


def parse_distortion(text: str) -> tuple[float, float, float, float, float]:
    """Coefficients k1, k2, p1, p2, k3 from "k1,k2,p1,p2,k3"; the last ones may be left out and are zero."""
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if not 1 <= len(numbers) <= 5 or not all(map(math.isfinite, numbers)):
        raise UserError(f"--dist {text}: must be one to five numbers k1,k2,p1,p2,k3")
    k1, k2, p1, p2, k3 = numbers + [0.0] * (5 - len(numbers))
    return k1, k2, p1, p2, k3


def _read(path: Path, how: int) -> Image:
    if not path.is_file():
        raise PictureError(f"{path}: {'is a folder, not a picture' if path.is_dir() else 'no such file'}")
    try:
        content = np.fromfile(path, np.uint8)
    except OSError as error:
        raise PictureError(f"{path}: cannot be read: {error.strerror}") from None
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # the fault is told below
    try:
        image = cv2.imdecode(content, how) if content.size else None
    except cv2.error:
        image = None
    finally:
        cv2.utils.logging.setLogLevel(level)
    if image is None:
        raise PictureError(f"{path}: not a picture that can be read (PNG, JPEG, TIFF, BMP, WebP and PGM can)")
    if min(image.shape[:2]) < 16:
        raise PictureError(f"{path}: {image.shape[1]}x{image.shape[0]} pixels: too small to see anything in")
    return np.asarray(image, np.uint8)
