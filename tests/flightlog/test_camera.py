import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightlog.camera import CameraModel, CameraMount

PLAIN = CameraModel.centred(768, 494, 952.4, 816.3)
LENS = replace(PLAIN, cx=380.2, cy=251.7, distortion=(-0.21, 0.06, 0.0011, -0.0007, 0.01))


def test_a_centred_camera_sees_its_axis_between_the_middle_pixels():
    np.testing.assert_allclose(PLAIN.project(np.array([[0.0, 0.0, 3.0]])), [[383.5, 246.5]])


@pytest.mark.parametrize("camera", [PLAIN, LENS])
def test_projection_agrees_with_opencv(camera):
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-3, 3, 200), rng.uniform(-2, 2, 200), rng.uniform(8, 12, 200)])
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion))
    np.testing.assert_allclose(camera.project(points), expected.reshape(-1, 2), atol=1e-9)


def test_distortion_moves_the_corners():
    corner = np.array([[0.38, 0.28, 1.0]])
    assert np.linalg.norm(LENS.project(corner) - replace(LENS, distortion=(0.0,) * 5).project(corner)) > 5.0


@pytest.mark.parametrize("camera", [PLAIN, LENS])
@given(x=st.floats(0, 767), y=st.floats(0, 493), depth=st.floats(0.1, 100))
def test_rays_invert_the_projection(camera, x, y, depth):
    ray = camera.rays(np.array([[x, y]]))
    assert ray[0, 2] == 1.0
    np.testing.assert_allclose(camera.project(depth * ray), [[x, y]], atol=1e-3 if camera.distorted else 1e-9)


def test_points_behind_have_no_pixel():
    pixels = PLAIN.project(np.array([[0.1, 0.1, -1.0], [0.1, 0.1, 0.0], [0.1, 0.1, 1.0]]))
    assert np.isnan(pixels[:2]).all()
    assert np.isfinite(pixels[2]).all()


def test_contains_keeps_the_margin_and_refuses_nan():
    pixels = np.array([[0.0, 0.0], [767.0, 493.0], [767.1, 100.0], [5.0, 5.0], [np.nan, 3.0]])
    assert PLAIN.contains(pixels).tolist() == [True, True, False, True, False]
    assert PLAIN.contains(pixels, margin=5.0).tolist() == [False, False, False, True, False]


def seen(mount: CameraMount, body_point):
    """Where a point in body axes lies in the picture, from its centre: right and down positive."""
    camera = CameraModel.centred(641, 481, 500.0)
    return camera.project((np.array(body_point, float) - mount.position) @ mount.axes)[0] - [320.0, 240.0]


@pytest.mark.parametrize("mount", [CameraMount.downward(np.zeros(3)), CameraMount.forward(np.zeros(3), 0.2)])
def test_camera_axes_are_a_rotation(mount):
    np.testing.assert_allclose(mount.axes @ mount.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(mount.axes) == pytest.approx(1.0)


def test_the_down_camera_has_forward_up_and_right_right():
    mount = CameraMount.downward(np.array([0.1, 0.0, -0.1]))
    np.testing.assert_allclose(seen(mount, (0.1, 0.0, -5.1)), (0, 0), atol=1e-9)
    assert seen(mount, (1.1, 0.0, -5.1)) == pytest.approx((0.0, -100.0))
    assert seen(mount, (0.1, -1.0, -5.1)) == pytest.approx((100.0, 0.0))


def test_the_forward_camera_has_up_up_and_right_right():
    mount = CameraMount.forward(np.array([0.4, 0.0, 0.0]))
    assert seen(mount, (5.4, 0.0, 1.0)) == pytest.approx((0.0, -100.0))
    assert seen(mount, (5.4, -1.0, 0.0)) == pytest.approx((100.0, 0.0))


def test_a_camera_turned_nose_down_sees_the_horizon_higher_up():
    mount = CameraMount.forward(np.zeros(3), math.radians(10.0))
    assert mount.axes[:, 2] == pytest.approx((math.cos(math.radians(10.0)), 0.0, -math.sin(math.radians(10.0))))
    assert seen(mount, (100.0, 0.0, 0.0)) == pytest.approx((0.0, -500.0 * math.tan(math.radians(10.0))))
