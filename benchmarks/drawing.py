"""Pictures of flat plates by supersampled area coverage, with known truth and chosen defects."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.pose import LevelAxes, MarkPose, directions, from_pad_plane, level_axes, on_pad_plane, place
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import HMark
from flightlog.rotations import quaternion

Floats = NDArray[np.float64]
Ink = Callable[[Floats, Floats], Floats]  # grey level of places x, y [m] of the plate; NaN where the ground shows

MOUNT = CameraMount.downward(np.zeros(3))
LIGHT, DARK, GROUND = 200.0, 60.0, 110.0


def h_ink(mark: HMark, side: float) -> Ink:
    """A light H on a dark square plate."""

    def ink(x: Floats, y: Floats) -> Floats:
        across, along = np.abs(x), np.abs(y)
        leg = (across <= mark.width / 2) & (across >= mark.width / 2 - mark.stroke) & (along <= mark.leg / 2)
        bar = (across <= mark.width / 2) & (along <= mark.stroke / 2)
        grey = np.where(leg | bar, LIGHT, DARK)
        return np.where(np.maximum(across, along) <= side / 2, grey, np.nan)

    return ink


def tag_ink(bits: NDArray[np.uint8], size: float, side: float) -> Ink:
    """A square code of cells (N, N), 0 dark, `size` [m] wide, on a light square plate."""
    cells = len(bits)

    def ink(x: Floats, y: Floats) -> Floats:
        column = np.floor((x / size + 0.5) * cells).astype(int)
        row = np.floor((0.5 - y / size) * cells).astype(int)
        within = (column >= 0) & (column < cells) & (row >= 0) & (row < cells)
        code = bits[np.clip(row, 0, cells - 1), np.clip(column, 0, cells - 1)]
        grey = np.where(within & (code == 0), DARK, LIGHT)
        return np.where(np.maximum(np.abs(x), np.abs(y)) <= side / 2, grey, np.nan)

    return ink


@dataclass(frozen=True, eq=False)
class Shot:
    """Where a plate lies before a camera."""

    camera: CameraModel
    attitude: Floats
    level: LevelAxes
    pose: MarkPose


def shot(camera: CameraModel, height: float, rng: np.random.Generator, *, tilt: float, stray: float) -> Shot:
    """A plate `height` [m] below, within `stray` of the picture's half size about its centre; tilt [rad] at most."""
    attitude = quaternion(*rng.uniform(-tilt, tilt, 2), rng.uniform(0.0, 2.0 * np.pi))
    level = level_axes(attitude, MOUNT)
    half = np.array([camera.width, camera.height]) / 2
    pixel = np.array([camera.cx, camera.cy]) + rng.uniform(-stray, stray, 2) * half
    right, forward = on_pad_plane(pixel[None], camera, level)[0]
    pose = MarkPose(from_pad_plane(right, forward, height, level), rng.uniform(-1.5, 1.5))
    return Shot(camera, attitude, level, pose)


def drawn(one: Shot, ink: Ink, side: float, ground: Floats | None = None) -> Floats:
    """Grey levels (H, W) of the plate on a ground (H, W), before blur and noise."""
    camera = one.camera
    grey = np.full((camera.height, camera.width), GROUND) if ground is None else ground.copy()
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (side / 2)
    pixels = camera.project(place(corners, one.pose, one.level))
    low = np.clip(np.floor(pixels.min(axis=0)) - 1, 0, None).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + 2, None, [camera.width, camera.height]).astype(int)
    if np.any(high <= low):
        return grey
    sub = 12 if (high - low).max() < 120 else 8 if (high - low).max() < 240 else 5
    width, height = high - low
    u = low[0] + (np.arange(width * sub) + 0.5) / sub - 0.5
    v = low[1] + (np.arange(height * sub) + 0.5) / sub - 0.5
    to_mark = np.linalg.inv(np.column_stack([*directions(one.pose, one.level), one.pose.position]))
    rx, ry = (u - camera.cx) / camera.fx, ((v - camera.cy) / camera.fy)[:, None]
    x, y, q = (row[0] * rx + row[1] * ry + row[2] for row in to_mark)
    fine = ink(x / q, y / q)
    below = np.repeat(np.repeat(grey[low[1] : high[1], low[0] : high[0]], sub, axis=0), sub, axis=1)
    fine = np.where(np.isnan(fine), below, fine).astype(np.float32)
    grey[low[1] : high[1], low[0] : high[0]] = cv2.resize(fine, (int(width), int(height)), interpolation=cv2.INTER_AREA)
    return grey


def photographed(
    grey: Floats, rng: np.random.Generator, *, blur: float = 0.7, noise: float = 5.0, sweep: Floats | None = None
) -> NDArray[np.uint8]:
    """The picture (H, W) of grey levels: round blur and motion [px], noise [grey levels], 8 bits."""
    soft = cv2.GaussianBlur(grey, (0, 0), blur)
    if sweep is not None:
        places = (np.arange(2 * int(np.hypot(*sweep)) + 2) + 0.5) / (2 * int(np.hypot(*sweep)) + 2) - 0.5
        size = (grey.shape[1], grey.shape[0])
        shifts = [np.array([[1.0, 0.0, f * sweep[0]], [0.0, 1.0, f * sweep[1]]]) for f in places]
        soft = np.mean([cv2.warpAffine(soft, s, size, borderMode=cv2.BORDER_REPLICATE) for s in shifts], axis=0)
    return np.clip(np.rint(soft + rng.normal(0.0, noise, grey.shape)), 0, 255).astype(np.uint8)
