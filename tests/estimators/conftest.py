"""Synthetic pictures with known truth: exact area coverage, no polygon filler and no OpenGL."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from estimators.vision.pose import LevelAxes, MarkPose, directions
from flightlog.camera import CameraModel
from flightlog.marks import HMark

cv2.setNumThreads(1)

Floats = NDArray[np.float64]
SUB = 16


def _inside(pixels: Floats, camera: CameraModel, pose: MarkPose, level: LevelAxes, mark: HMark) -> NDArray[np.bool_]:
    """Whether the rays of pixels (N, 2) meet the mark."""
    x_axis, y_axis = directions(pose, level)
    rays = camera.rays(pixels)
    facing = rays @ level.up
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (pose.position @ level.up) / facing
    arms = rays * distance[:, None] - pose.position
    x, y = np.abs(arms @ x_axis), np.abs(arms @ y_axis)
    legs = (x <= mark.width / 2) & (x >= mark.width / 2 - mark.stroke) & (y <= mark.leg / 2)
    bar = (x <= mark.width / 2) & (y <= mark.stroke / 2)
    return (facing < 0) & (distance > 0) & (legs | bar)


def coverage(camera: CameraModel, pose: MarkPose, level: LevelAxes, mark: HMark) -> Floats:
    """Share (H, W) of each pixel that the mark covers: 16 x 16 sub-samples in every pixel that an edge may cross."""
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    centres = np.column_stack([columns.ravel(), rows.ravel()]).astype(float)
    full = _inside(centres, camera, pose, level, mark).reshape(rows.shape)
    kernel = np.ones((3, 3), np.uint8)
    crossed = cv2.morphologyEx(full.astype(np.uint8), cv2.MORPH_GRADIENT, kernel)
    crossed = np.argwhere(cv2.dilate(crossed, kernel) > 0)
    share = full.astype(float)
    if len(crossed):
        sub = (np.arange(SUB) + 0.5) / SUB - 0.5
        dx, dy = np.meshgrid(sub, sub)
        points = crossed[:, None, ::-1] + np.column_stack([dx.ravel(), dy.ravel()])[None]
        inside = _inside(points.reshape(-1, 2), camera, pose, level, mark).reshape(len(crossed), -1)
        share[crossed[:, 0], crossed[:, 1]] = inside.mean(axis=1)
    return share


@dataclass(frozen=True)
class Look:
    """Grey levels and defects of a synthetic picture."""

    mark: float = 200.0
    ground: float = 80.0
    blur: float = 0.7  # [px]
    noise: float = 5.0  # [grey levels]
    texture: float = 0.0  # [grey levels] of clutter with a grain of 3 px


def picture(
    camera: CameraModel,
    pose: MarkPose,
    level: LevelAxes,
    mark: HMark,
    rng: np.random.Generator,
    look: Look = Look(),
) -> NDArray[np.uint8]:
    """A grey picture (H, W) of the mark on its ground."""
    ground = np.full((camera.height, camera.width), look.ground)
    if look.texture:
        grain = cv2.GaussianBlur(rng.standard_normal(ground.shape), (0, 0), 3.0)
        ground += look.texture * grain / grain.std()
    share = coverage(camera, pose, level, mark)
    grey = ground + share * (look.mark - ground)
    grey = cv2.GaussianBlur(grey, (0, 0), look.blur) if look.blur else grey
    grey = grey + rng.normal(0.0, look.noise, grey.shape)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class Painter:
    """The functions above, handed to tests."""

    picture = staticmethod(picture)
    coverage = staticmethod(coverage)
    Look = Look


@pytest.fixture
def painter() -> Painter:
    return Painter()
