"""The horizon front end on synthetic skies with known attitude."""

import math

import cv2
import numpy as np
import pytest

from estimators.vision.horizon import HorizonFrontEnd
from estimators.vision.horizon_fit import lower_line
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


def test_hills_with_a_foot_cost_nothing() -> None:
    """Pale hills on the horizon, their foot against the darker ground: the foot is taken, and stated as sharp."""
    mount = CameraMount.forward(np.zeros(3))
    front_end, rng = HorizonFrontEnd(PLAIN, mount), np.random.default_rng(6)
    for _ in range(3):
        roll, pitch = rng.uniform(-0.3, 0.3), rng.uniform(-0.1, 0.1)
        picture = sky(PLAIN, mount, roll, pitch, rng).astype(float)
        axes = matrix(quaternion(roll, pitch, 0.0)) @ mount.axes
        x, y = np.meshgrid(np.arange(640.0), np.arange(480.0))
        rays = PLAIN.rays(np.column_stack([x.ravel(), y.ravel()])) @ axes.T
        elevation = np.arctan2(rays[:, 2], np.hypot(rays[:, 0], rays[:, 1])).reshape(480, 640)
        azimuth = np.arctan2(rays[:, 1], rays[:, 0]).reshape(480, 640)
        top = np.radians(1.2) * (1.0 + 0.5 * np.sin(9 * azimuth) + 0.3 * np.sin(31 * azimuth + 1.0))
        hill = (np.clip((elevation * PLAIN.fx + 0.5), 0, 1) * (elevation < top))[:, :, None]
        picture += hill * (np.array([120.0, 140.0, 150.0]) - picture)
        seen = front_end.see(np.clip(np.rint(picture), 0, 255).astype(np.uint8))
        assert seen is not None
        assert math.degrees(abs(seen.roll - roll)) < 0.05
        assert math.degrees(abs(seen.pitch - pitch)) < 0.1  # the sky blurred into the ground before shines through
        assert math.degrees(seen.std_pitch) < 0.05


def test_a_pale_band_of_far_land_belongs_to_the_ground() -> None:
    """Land as pale as this hides the horizon from the strongest edge, which lies at its near end."""
    mount = CameraMount.forward(np.zeros(3))
    rng = np.random.default_rng(7)
    for roll in (-0.2, 0.15):
        y, x = np.mgrid[0:480, 0:640]
        below = y - (240.0 - (x - 319.5) * math.tan(roll))
        band = 12.0 + 0.02 * (x - 320.0)  # [px] no straight strip
        grey = np.where(below < 0, 235.0, np.where(below < band, 220.0, 90.0))[:, :, None] * [1.0, 1.0, 0.97]
        grey = cv2.GaussianBlur(grey, (0, 0), 0.8) + rng.normal(0, 2, (480, 640, 3))
        grey[300:] += 15 * rng.standard_normal((180, 640, 1))
        seen = HorizonFrontEnd(PLAIN, mount).see(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
        assert seen is not None
        assert math.degrees(abs(seen.roll - roll)) < 0.2
        assert math.degrees(abs(seen.pitch)) < 0.15


def test_an_aeroplane_a_tower_and_a_wing_do_not_bend_the_line() -> None:
    mount = CameraMount.forward(np.zeros(3))
    picture = sky(PLAIN, mount, 0.2, 0.03, np.random.default_rng(8))
    cv2.line(picture, (250, 120), (300, 128), (20, 20, 20), 5)
    cv2.rectangle(picture, (420, 120), (440, 300), (90, 80, 80), -1)
    cv2.fillPoly(picture, [np.array([[0, 479], [0, 330], [180, 479]])], (250, 250, 250))
    seen = HorizonFrontEnd(PLAIN, mount).see(picture)
    assert seen is not None
    assert math.degrees(abs(seen.roll - 0.2)) < 0.05
    assert math.degrees(abs(seen.pitch - 0.03)) < 0.03


def test_a_line_drawn_in_steps_of_a_pixel_is_straight() -> None:
    """Renderers without smoothing, and small cameras: half a pixel either way, and no bias."""
    y, x = np.mgrid[0:480, 0:640]
    for roll in (0.02, 0.11, -0.3):
        above = y < np.rint(200.25 - (x - 319.5) * math.tan(roll))
        seen = HorizonFrontEnd(PLAIN, CameraMount.forward(np.zeros(3))).see(np.where(above, 200, 60).astype(np.uint8))
        assert seen is not None
        assert math.degrees(abs(seen.roll - roll)) < 0.03
        assert math.degrees(abs(seen.pitch - math.atan((200.25 - 0.5 - PLAIN.cy) * math.cos(roll) / 560.0))) < 0.03


def test_a_large_picture_is_reduced_and_a_dark_one_is_seen() -> None:
    large = CameraModel.centred(2560, 1440, 1900.0)
    mount = CameraMount.forward(np.zeros(3))
    small = CameraModel.centred(640, 360, 475.0)
    picture = cv2.resize(sky(small, mount, -0.15, 0.04, np.random.default_rng(9)), (2560, 1440))
    seen = HorizonFrontEnd(large, mount).see(np.asarray(picture, np.uint8))
    assert seen is not None
    assert (seen.roll, seen.pitch) == pytest.approx((-0.15, 0.04), abs=1e-3)
    dusk = (0.25 * sky(PLAIN, mount, 0.2, 0.0, np.random.default_rng(10))).astype(np.uint8)
    seen = HorizonFrontEnd(PLAIN, mount).see(dusk)
    assert seen is not None
    assert seen.roll == pytest.approx(0.2, abs=2e-3)


def test_what_stands_above_a_line_does_not_lift_it_and_even_noise_is_plain_least_squares() -> None:
    rng = np.random.default_rng(11)
    s = np.linspace(-0.5, 0.5, 300)
    jacobian = np.column_stack([np.cos(s), np.sin(s)]) * 500.0
    truth = np.array([0.003, -0.002])
    noise = 0.1 * rng.standard_normal(300)
    hills = np.where(np.sin(40 * s) > 0.3, -6.0, 0.0)  # upward is negative
    turn, _, weights, scale = lower_line(jacobian, jacobian @ truth + noise + hills, 0.05)
    np.testing.assert_allclose(turn, truth, atol=1e-4)
    assert 0.05 < scale < 0.2
    assert weights[hills < 0].max() < 0.01
    plain, *_ = np.linalg.lstsq(jacobian, jacobian @ truth + noise, rcond=None)
    turn, *_ = lower_line(jacobian, jacobian @ truth + noise, 0.05)
    np.testing.assert_allclose(turn, plain, atol=2e-5)
