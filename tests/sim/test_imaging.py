"""What a camera makes of a clean picture: lens, motion, blur, noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flightlog.camera import DOWN, CameraModel
from flightlog.rotations import matrix, quaternion
from sim.cameras import blur, noise
from sim.cameras.blur import Blur, image_motion, kernel
from sim.cameras.noise import Noise
from sim.cameras.optics import Lens, pinhole_behind

DOWN_MODEL = CameraModel.centred(768, 494, 952.4, 816.3)


def test_an_impossible_lens_is_refused():
    with pytest.raises(ValueError, match="cannot be inverted"):
        pinhole_behind(replace(DOWN_MODEL, distortion=(-3.0, 0.0, 0.0, 0.0, 0.0)))


def test_a_lens_bends_straight_lines_as_opencv_s_model_does():
    model = replace(DOWN_MODEL, distortion=(-0.2, 0.05, 0.001, 0.0, 0.0))
    behind = pinhole_behind(model)
    x = np.tile(np.arange(behind.width), (behind.height, 1))
    ramp = (x / behind.width * 255).astype(np.uint8)
    bent = Lens.of(model).bend(ramp)
    pixels = np.random.default_rng(0).uniform(0, [767, 493], (200, 2)).round()
    expected = behind.project(model.rays(pixels))[:, 0] / behind.width * 255
    assert bent[pixels[:, 1].astype(int), pixels[:, 0].astype(int)] == pytest.approx(expected, abs=1.5)


@pytest.mark.parametrize("level", [0, 20, 120, 250])
def test_noise_has_the_variance_it_declares(level):
    model = Noise(read=1.5, shot=3.0)
    flat = np.full((494, 768), level, np.uint8)
    noisy = noise.apply(flat, model, np.random.default_rng(0)).astype(float)
    if level == 120 or level == 20:
        assert noisy.std() == pytest.approx(math.sqrt(1.5**2 + 9.0 * level / 255 + 1 / 12), rel=0.03)
        assert noisy.mean() == pytest.approx(level, abs=0.02)
    assert noisy.min() >= 0
    assert noisy.max() <= 255


def test_image_motion_is_the_derivative_of_the_projection():
    rng = np.random.default_rng(4)
    for _ in range(10):
        q = quaternion(*rng.uniform(-0.2, 0.2, 2), rng.uniform(0, 6))
        position = np.array([0.3, -0.2, rng.uniform(1, 10)])
        velocity, rates = rng.normal(0, 1, 3), rng.normal(0, 0.5, 3)
        axes = matrix(q) @ DOWN
        speed = image_motion(DOWN_MODEL, axes, position, velocity, rates)
        # the ground point on the optical axis, a moment later
        spot = position - axes[:, 2] * position[2] / axes[2, 2]
        dt = 1e-6
        turned = axes + dt * np.cross(rates, axes.T).T
        moved = DOWN_MODEL.project((spot - position - dt * velocity) @ turned)[0]
        assert (moved - [DOWN_MODEL.cx, DOWN_MODEL.cy]) / dt == pytest.approx(speed, rel=1e-3, abs=0.05)


def test_motion_blur_draws_a_point_out_along_its_way():
    point = np.zeros((41, 41), np.uint8)
    point[20, 20] = 255
    streak = blur.apply(point, Blur(defocus=0.3, exposure_time=0.01), (600.0, 800.0)).astype(float)  # 6 x 8 px
    y, x = np.mgrid[-20:21, -20:21]
    spread = np.array([[np.sum(streak * a * b) for a in (x, y)] for b in (x, y)]) / streak.sum()
    assert spread == pytest.approx(np.outer([6, 8], [6, 8]) / 12 + 0.3**2 * np.eye(2), abs=0.35)
    assert kernel(0.4, (3.0, -4.0)).sum() == pytest.approx(1.0)
