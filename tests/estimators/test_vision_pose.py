"""Level axes, the mark's angle, and the derivatives that the fit relies on."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr

from estimators.vision.edges import KERNEL, edge_offsets
from estimators.vision.outline import OutlineSamples, view
from estimators.vision.pose import (
    MarkPose,
    from_pad_plane,
    level_axes,
    on_pad_plane,
    place,
    project_with_slopes,
    wrap_axis,
)
from estimators.vision.robust import solve
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import HMark
from flightlog.rotations import matrix, quaternion

CAMERA = CameraModel.centred(768, 494, 952.4, 816.3)
LENS = CameraModel(768, 494, 952.4, 816.3, 380.0, 250.0, (-0.28, 0.08, 1e-3, -5e-4, 0.0))
MOUNT = CameraMount.downward(np.zeros(3))
tilts = st.floats(-0.4, 0.4)


@given(tilts, tilts, st.floats(0, 2 * math.pi - 1e-9), st.floats(0, math.pi))
def test_heading_of_the_mark_is_heading_of_the_camera_plus_angle(
    roll: float, pitch: float, heading: float, mark_heading: float
) -> None:
    q = quaternion(roll, pitch, heading)
    world_from_camera = matrix(q) @ MOUNT.axes
    level = level_axes(q, MOUNT)
    angle = mark_heading - heading
    tip = world_from_camera @ (place(np.array([[0.0, 1.0]]), MarkPose(np.zeros(3), angle), level)[0])
    np.testing.assert_allclose(tip, [math.sin(mark_heading), math.cos(mark_heading), 0.0], atol=1e-12)
    right = world_from_camera @ (place(np.array([[1.0, 0.0]]), MarkPose(np.zeros(3), angle), level)[0])
    np.testing.assert_allclose(right, [math.cos(mark_heading), -math.sin(mark_heading), 0.0], atol=1e-12)
    np.testing.assert_allclose(world_from_camera @ level.up, [0.0, 0.0, 1.0], atol=1e-12)


def test_angle_is_clockwise_from_image_up_when_level() -> None:
    level = level_axes(quaternion(0.0, 0.0, 1.234), MOUNT)
    foot, tip = CAMERA.project(
        place(np.array([[0.0, 0.0], [0.0, 0.5]]), MarkPose(np.array([0, 0, 5.0]), math.radians(30.0)), level)
    )
    dx, dy = (tip - foot) / [CAMERA.fx, CAMERA.fy]
    assert math.atan2(dx, -dy) == pytest.approx(math.radians(30.0))


@given(tilts, tilts, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(0.3, 30.0))
def test_pad_plane_and_back(roll: float, pitch: float, right: float, forward: float, height: float) -> None:
    level = level_axes(quaternion(roll, pitch, 2.0), MOUNT)
    point = from_pad_plane(right, forward, height, level)
    assert -point @ level.up == pytest.approx(height)
    if point[2] > 0.1:
        np.testing.assert_allclose(on_pad_plane(LENS.project(point), LENS, level)[0], [right, forward], atol=1e-3)
        np.testing.assert_allclose(on_pad_plane(CAMERA.project(point), CAMERA, level)[0], [right, forward], atol=1e-9)


@pytest.mark.parametrize("camera", [CAMERA, LENS])
def test_slopes_of_the_projection_against_differences(camera: CameraModel) -> None:
    points = np.array([[0.1, -0.2, 2.0], [-0.5, 0.3, 1.5], [0.0, 0.0, 7.0]])
    pixels, slopes = project_with_slopes(camera, points)
    np.testing.assert_allclose(pixels, camera.project(points), atol=1e-9)
    for k in range(3):
        step = np.zeros(3)
        step[k] = 1e-6
        difference = (camera.project(points + step) - camera.project(points - step)) / 2e-6
        np.testing.assert_allclose(slopes[:, :, k], difference, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("camera", [CAMERA, LENS])
@settings(max_examples=20, deadline=None)
@given(tilts, tilts, st.floats(-3, 3))
def test_jacobian_of_the_outline_against_differences(
    camera: CameraModel, roll: float, pitch: float, angle: float
) -> None:
    level = level_axes(quaternion(roll, pitch, 0.4), MOUNT)
    samples = OutlineSamples.of(HMark(1.2, 0.9, 0.15).outline(), per_edge=3)
    pose = MarkPose(np.array([0.2, -0.1, 4.0]), angle)
    shown = view(samples, camera, pose, level)

    def moved(k: int, step: float) -> np.ndarray:
        delta = np.zeros(6)
        delta[k] = step
        at = MarkPose(pose.position + delta[:3], pose.angle + delta[3])
        return view(samples, camera, at, level.turned(np.append(delta[4:], 0.0))).pixels

    for k in range(6):
        difference = (moved(k, 1e-6) - moved(k, -1e-6)) / 2e-6
        along_normal = np.sum(shown.normals * difference, axis=1)
        np.testing.assert_allclose(shown.jacobian[:, k], along_normal, rtol=2e-4, atol=2e-2)


def test_normals_point_out_of_the_mark() -> None:
    level = level_axes(quaternion(0.1, -0.2, 1.0), MOUNT)
    pose = MarkPose(np.array([0.0, 0.0, 5.0]), 0.7)
    samples = OutlineSamples.of(HMark().outline(), per_edge=5)
    shown = view(samples, CAMERA, pose, level)
    corners = CAMERA.project(place(HMark().outline(), pose, level)).astype(np.float32)
    for pixel, normal in zip(shown.pixels, shown.normals, strict=True):
        outer, inner = pixel + 2.0 * normal, pixel - 2.0 * normal
        assert cv2.pointPolygonTest(corners, outer.tolist(), False) < 0
        assert cv2.pointPolygonTest(corners, inner.tolist(), False) > 0


@given(st.floats(-20, 20))
def test_an_axis_has_no_direction(angle: float) -> None:
    wrapped = wrap_axis(angle)
    assert -math.pi / 2 < wrapped <= math.pi / 2
    assert math.sin(wrapped - angle) == pytest.approx(0.0, abs=1e-9)


def test_image_up_must_not_be_vertical() -> None:
    with pytest.raises(ValueError, match="image up is vertical"):
        level_axes(quaternion(0.0, math.pi / 2, 0.0), MOUNT)


def step_picture(place_: float, slope: float, blur: float = 0.7) -> np.ndarray:
    """Bright left of x = place + slope * y through a Gaussian spot, integrated over each pixel's area."""
    sub = (np.arange(8) + 0.5) / 8 - 0.5
    y = np.arange(60)[:, None, None, None] + sub[None, None, :, None]
    x = np.arange(80)[None, :, None, None] + sub[None, None, None, :]
    distance = (place_ + slope * y - x) / math.hypot(1.0, slope)
    return np.rint(60.0 + 140.0 * ndtr(distance / blur).mean(axis=(2, 3))).astype(np.uint8)


@pytest.mark.parametrize("place_", [39.6, 39.85, 40.0, 40.3])
@pytest.mark.parametrize("slope", [0.0, 0.31])
def test_edges_are_found_to_a_fiftieth_of_a_pixel_without_bias(place_: float, slope: float) -> None:
    image = step_picture(place_, slope)
    normal = np.array([1.0, -slope]) / math.hypot(1.0, slope)
    y = np.linspace(20.0, 40.0, 41)
    points = np.column_stack([40.0 + slope * y, y])
    offsets, heights = edge_offsets(image, points, np.tile(normal, (41, 1)), 4.0, 1.0, KERNEL)
    truth = (place_ - 40.0) * normal[0]
    assert abs(np.mean(offsets) - truth) < 0.01
    np.testing.assert_allclose(offsets, truth, atol=0.02)
    assert np.all(heights > 100.0)


def test_an_edge_of_the_wrong_contrast_is_not_taken() -> None:
    image = step_picture(40.0, 0.0)
    points, normals = np.array([[40.0, 30.0]]), np.array([[1.0, 0.0]])
    _, right = edge_offsets(image, points, normals, 4.0, 1.0, KERNEL)
    _, wrong = edge_offsets(image, points, normals, 4.0, -1.0, KERNEL)
    assert right[0] > 100.0
    assert wrong[0] < 20.0


def test_search_ends_at_the_border_and_reads_nothing_beyond() -> None:
    image = step_picture(40.0, 0.0)
    points = np.array([[76.0, 30.0], [-3.0, 30.0], [40.0, 59.5], [np.nan, 1.0]])
    offsets, _ = edge_offsets(image, points, np.tile([1.0, 0.0], (4, 1)), 30.0, 1.0, KERNEL)
    assert np.all(np.isnan(offsets[1:]))
    near = np.array([[72.0, 30.0]])
    offsets, _ = edge_offsets(image, near, np.array([[1.0, 0.0]]), 40.0, 1.0, KERNEL)
    assert offsets[0] == pytest.approx(-32.0, abs=0.05)


def test_robust_step_ignores_a_third_of_outliers_and_matches_least_squares_without() -> None:
    rng = np.random.default_rng(3)
    jacobian = rng.normal(size=(300, 3))
    truth = np.array([0.4, -0.2, 0.1])
    offsets = jacobian @ truth + rng.normal(0, 0.1, 300)
    none = np.full(3, 1e-12)
    step, _, scale = solve(jacobian, offsets, none, np.zeros(3))
    plain = np.linalg.lstsq(jacobian, offsets, rcond=None)[0]
    np.testing.assert_allclose(step, plain, atol=0.005)
    assert scale == pytest.approx(0.1, rel=0.2)
    offsets[:100] += rng.uniform(1.0, 3.0, 100)
    step, _, _ = solve(jacobian, offsets, none, np.zeros(3))
    np.testing.assert_allclose(step, truth, atol=0.04)


def test_prior_holds_what_the_measurements_leave_open() -> None:
    jacobian = np.column_stack([np.ones(50), np.zeros(50)])
    step, _, _ = solve(jacobian, np.full(50, 0.7), np.array([1e-6, 4.0]), np.array([0.0, 0.3]))
    np.testing.assert_allclose(step, [0.7, 0.3], atol=1e-3)
