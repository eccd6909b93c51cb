"""The horizon front end on synthetic skies with known attitude."""

import math

import cv2
import numpy as np
import pytest

from estimators.vision.horizon import HorizonFrontEnd
from flightlog.camera import CameraModel, CameraMount
from flightlog.rotations import matrix, quaternion

PLAIN = CameraModel.centred(640, 480, 560.0)
OBLONG = CameraModel.centred(640, 480, 500.0, 520.0)
BENT = CameraModel(640, 480, 450.0, 450.0, 319.5, 239.5, (-0.25, 0.06, 0.0, 0.0, 0.0))


def sky(
    camera: CameraModel, mount: CameraMount, roll: float, pitch: float, rng: np.random.Generator, hills: float = 0.0
) -> np.ndarray:
    """A picture (H, W, 3): clouded sky over textured ground; `hills` [rad] high."""
    axes = matrix(quaternion(roll, pitch, 0.3)) @ mount.axes
    height, width = camera.height, camera.width
    sub = np.array([-0.25, 0.25])
    x, y = np.meshgrid((np.arange(width)[:, None] + sub).ravel(), (np.arange(height)[:, None] + sub).ravel())
    rays = camera.rays(np.column_stack([x.ravel(), y.ravel()])) @ axes.T
    elevation = np.arctan2(rays[:, 2], np.hypot(rays[:, 0], rays[:, 1]))
    azimuth = np.arctan2(rays[:, 1], rays[:, 0])
    skyline = sum(hills * a * np.sin(k * azimuth + rng.uniform(0, 6)) for a, k in ((1.0, 9), (0.6, 23), (0.4, 41)))
    share = (elevation > skyline).reshape(height, 2, width, 2).mean(axis=(1, 3))[:, :, None]
    cloud = cv2.GaussianBlur(rng.standard_normal((height, width)), (0, 0), 25)
    grass = cv2.GaussianBlur(rng.standard_normal((height, width)), (0, 0), 2)
    above = np.array([150.0, 185.0, 225.0]) + (20 * np.clip(cloud / cloud.std(), 0, 2))[:, :, None]
    below = np.array([70.0, 95.0, 60.0]) + (12 * grass / grass.std())[:, :, None]
    picture = cv2.GaussianBlur(below + share * (above - below), (0, 0), 0.7) + rng.normal(0, 4, (height, width, 3))
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("camera", "nose_down_deg"), [(PLAIN, 0.0), (OBLONG, 10.0), (BENT, 0.0)])
def test_straight_horizon_to_hundredths_of_a_degree(camera: CameraModel, nose_down_deg: float) -> None:
    mount = CameraMount.forward(np.zeros(3), math.radians(nose_down_deg))
    front_end, rng = HorizonFrontEnd(camera, mount), np.random.default_rng(1)
    for _ in range(6):
        roll, pitch = rng.uniform(-0.5, 0.5), rng.uniform(-0.12, 0.12) + 0.8 * math.radians(nose_down_deg)
        seen = front_end.see(sky(camera, mount, roll, pitch, rng))
        assert seen is not None
        assert math.degrees(abs(seen.roll - roll)) < 0.03
        assert math.degrees(abs(seen.pitch - pitch)) < 0.01
        assert abs(seen.roll - roll) < 4 * seen.std_roll
        assert abs(seen.pitch - pitch) < 4 * seen.std_pitch


@pytest.mark.parametrize(("roll", "pitch"), [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.1), (0.0, -0.1)])
def test_signs_and_line_ends(roll: float, pitch: float) -> None:
    """Right side down: the line rises to the right; nose up: it lies below the middle."""
    mount = CameraMount.forward(np.zeros(3))
    seen = HorizonFrontEnd(PLAIN, mount).see(sky(PLAIN, mount, roll, pitch, np.random.default_rng(2)))
    assert seen is not None
    (x0, y0), (x1, y1) = seen.line
    assert x0 < x1
    assert math.atan2(y0 - y1, x1 - x0) == pytest.approx(roll, abs=2e-3)
    assert (y0 + y1) / 2 - PLAIN.cy == pytest.approx(PLAIN.fy * math.tan(pitch), abs=3.0)


def test_hills_cost_accuracy_and_are_declared() -> None:
    mount = CameraMount.forward(np.zeros(3))
    front_end, rng = HorizonFrontEnd(PLAIN, mount), np.random.default_rng(3)
    for _ in range(6):
        roll, pitch = rng.uniform(-0.3, 0.3), rng.uniform(-0.1, 0.1)
        seen = front_end.see(sky(PLAIN, mount, roll, pitch, rng, hills=math.radians(0.2)))
        assert seen is not None
        assert math.degrees(seen.std_roll) > 0.05
        assert abs(seen.roll - roll) < 3 * seen.std_roll
        assert abs(seen.pitch - pitch) < 3 * seen.std_pitch
        assert math.degrees(abs(seen.roll - roll)) < 0.3


def test_a_grey_picture_serves_too() -> None:
    mount = CameraMount.forward(np.zeros(3))
    grey = cv2.cvtColor(sky(PLAIN, mount, 0.1, 0.05, np.random.default_rng(4)), cv2.COLOR_RGB2GRAY)
    seen = HorizonFrontEnd(PLAIN, mount).see(np.asarray(grey, np.uint8))
    assert seen is not None
    assert seen.roll == pytest.approx(0.1, abs=1e-3)
    assert seen.pitch == pytest.approx(0.05, abs=1e-3)


def test_no_horizon_no_answer() -> None:
    mount = CameraMount.forward(np.zeros(3))
    front_end, rng = HorizonFrontEnd(PLAIN, mount), np.random.default_rng(5)
    for pitch in (0.8, -0.8):  # only sky, only ground
        assert front_end.see(sky(PLAIN, mount, 0.0, pitch, rng)) is None
    for level in (0, 128, 255):
        assert front_end.see(np.full((480, 640, 3), level, np.uint8)) is None
    assert front_end.see(rng.integers(0, 255, (480, 640, 3), np.uint8)) is None


def test_a_picture_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="picture: 320x240, the camera has 640x480"):
        HorizonFrontEnd(PLAIN, CameraMount.forward(np.zeros(3))).see(np.zeros((240, 320, 3), np.uint8))
