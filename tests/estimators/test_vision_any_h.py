"""The H of unknown proportions: drawn by area coverage, small, smeared, dark or cut; and what is no H."""

import math
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from estimators.vision.any_h import AnyHFrontEnd
from estimators.vision.blurred_h import appearance, parts, share
from estimators.vision.cut_h import PLACES, QUARTERS, enough_seen
from estimators.vision.h_mark import HMarkFrontEnd
from estimators.vision.pose import MarkPose, from_pad_plane, level_axes, on_pad_plane, place, wrap_axis
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import HMark
from flightlog.rotations import quaternion

CAMERA = CameraModel.centred(320, 240, 300.0)
MOUNT = CameraMount.downward(np.zeros(3))


def placed(mark: HMark, leg: float, angle: float, at: tuple[float, float], q: np.ndarray) -> MarkPose:
    """The mark with legs of about `leg` [px], its centre at a pixel."""
    level = level_axes(q, MOUNT)
    right, forward = on_pad_plane(np.array([at]), CAMERA, level)[0]
    return MarkPose(from_pad_plane(right, forward, mark.leg * CAMERA.fx / leg, level), angle)


def smeared(image: np.ndarray, sweep: tuple[float, float]) -> np.ndarray:
    """Mean over a straight motion [px]."""
    places = (np.arange(24) + 0.5) / 24 - 0.5
    moved = [
        cv2.warpAffine(image.astype(np.float32), np.array([[1, 0, f * sweep[0]], [0, 1, f * sweep[1]]], np.float32),
                       image.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
        for f in places
    ]  # fmt: skip
    return np.rint(np.mean(moved, axis=0)).astype(np.uint8)


@settings(max_examples=4, suppress_health_check=[HealthCheck.function_scoped_fixture], derandomize=True)
@given(
    width=st.floats(0.6, 1.2), stroke=st.floats(0.12, 0.3), leg=st.floats(26.0, 120.0), angle=st.floats(-1.5, 1.5),
    light=st.booleans(),
)  # fmt: skip
def test_any_plain_h_is_found_and_measured(
    painter: Any, width: float, stroke: float, leg: float, angle: float, light: bool
) -> None:
    mark = HMark(1.0, width, min(stroke, 0.4 * width))
    q = quaternion(0.03, -0.02, 0.4)
    pose = placed(mark, leg, angle, (165.0, 116.0), q)
    look = painter.Look(noise=3.0) if light else painter.Look(mark=70.0, ground=180.0, noise=3.0)
    image = painter.picture(CAMERA, pose, level_axes(q, MOUNT), mark, np.random.default_rng(1), look)
    found = AnyHFrontEnd(CAMERA, MOUNT, 1.0).find(image, q)
    assert found is not None
    seen = found.pad
    assert np.abs(seen.position - pose.position).max() < (0.008 + 0.25 / leg) * pose.position[2]
    assert abs(wrap_axis(seen.angle - angle)) < math.radians(1.0)
    assert np.all(np.abs(seen.position - pose.position) < 6.0 * seen.std_position)
    assert abs(found.mark.width - mark.width) < 0.03 + 0.6 / leg
    assert abs(found.mark.stroke - mark.stroke) < 0.02 + 0.6 / leg
    assert (seen.contrast > 0.0) == light


@pytest.mark.parametrize("sweep", [(9.0, 0.0), (6.0, 6.0)])
def test_a_smeared_h_has_its_size(painter: Any, sweep: tuple[float, float]) -> None:
    """Motion by a third of the leg and twice the stroke: edges are gone, the size is not."""
    mark, q = HMark(1.0, 0.8, 0.15), quaternion(0.0, 0.0, 0.0)
    pose = placed(mark, 30.0, 0.1, (150.0, 120.0), q)
    look = painter.Look(noise=0.0)
    sharp = painter.picture(CAMERA, pose, level_axes(q, MOUNT), mark, np.random.default_rng(2), look)
    noisy = smeared(sharp, sweep) + np.random.default_rng(3).normal(0.0, 2.0, sharp.shape)
    seen = AnyHFrontEnd(CAMERA, MOUNT, 1.0).see(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), q)
    assert seen is not None
    assert abs(seen.position[2] - pose.position[2]) < 0.02 * pose.position[2]
    assert abs(wrap_axis(seen.angle - 0.1)) < math.radians(2.0)


@pytest.mark.parametrize("at", [(44.0, 120.0), (280.0, 112.0), (160.0, 6.0)])
@pytest.mark.parametrize("known", [True, False])
def test_a_cut_h_is_found_unexpected(painter: Any, at: tuple[float, float], known: bool) -> None:
    mark, q = HMark(1.0, 0.9, 0.2), quaternion(0.02, 0.03, 0.0)
    level = level_axes(q, MOUNT)
    pose = placed(mark, 110.0, 0.15, at, q)
    corners = CAMERA.project(place(mark.outline(), pose, level))
    assert enough_seen(corners, CAMERA) and not CAMERA.contains(corners).all()
    image = painter.picture(CAMERA, pose, level, mark, np.random.default_rng(4), painter.Look(noise=3.0))
    eye = HMarkFrontEnd(CAMERA, MOUNT, mark) if known else AnyHFrontEnd(CAMERA, MOUNT, 1.0)
    seen = eye.see(image, q)
    assert seen is not None and seen.source == "cut" and seen.visible < 1.0
    assert np.all(np.abs(seen.position - pose.position) < 5.0 * seen.std_position + 0.002)
    assert np.abs(seen.position - pose.position).max() < (0.01 if known else 0.1) * pose.position[2]


def test_less_than_that_is_not_taken_for_an_h(painter: Any) -> None:
    """Two leg ends of one leg: a bar with a stub, which many things are."""
    mark, q = HMark(1.0, 0.9, 0.2), quaternion(0.0, 0.0, 0.0)
    pose = placed(mark, 120.0, 0.0, (-30.0, 120.0), q)
    image = painter.picture(CAMERA, pose, level_axes(q, MOUNT), mark, np.random.default_rng(5), painter.Look())
    assert AnyHFrontEnd(CAMERA, MOUNT, 1.0).see(image, q) is None
    assert HMarkFrontEnd(CAMERA, MOUNT, mark).see(image, q) is None


def letter(draw: Any) -> np.ndarray:
    """A light figure on dark ground, softened."""
    canvas = np.full((240, 320), 70, np.uint8)
    draw(canvas)
    return np.asarray(cv2.GaussianBlur(canvas, (0, 0), 0.8), np.uint8)


def box(x: int, y: int, w: int, h: int) -> Any:
    return lambda canvas: cv2.rectangle(canvas, (x, y), (x + w, y + h), 200, -1)


def boxes(*all_of_them: tuple[int, int, int, int]) -> Any:
    return lambda canvas: [box(*one)(canvas) for one in all_of_them]


OTHERS = {
    "square": boxes((120, 80, 80, 80)),
    "plus": boxes((120, 112, 80, 16), (152, 80, 16, 80)),
    "T": boxes((120, 80, 80, 16), (152, 80, 16, 80)),
    "U": boxes((120, 80, 16, 80), (184, 80, 16, 80), (120, 144, 80, 16)),
    "E": boxes((120, 80, 16, 80), (120, 80, 64, 16), (120, 112, 64, 16), (120, 144, 64, 16)),
    "equals": boxes((120, 80, 16, 80), (184, 80, 16, 80)),
    "window": boxes((120, 80, 16, 96), (184, 80, 16, 96), (120, 80, 80, 16), (120, 120, 80, 16), (120, 160, 80, 16)),
    "A": boxes((120, 80, 16, 80), (184, 80, 16, 80), (120, 80, 80, 16), (120, 112, 80, 16)),
    "h": boxes((120, 80, 16, 80), (184, 112, 16, 48), (120, 112, 80, 16)),
    "disc": lambda canvas: cv2.circle(canvas, (160, 120), 40, 200, -1),
    "N": lambda canvas: [
        boxes((120, 80, 14, 80), (186, 80, 14, 80))(canvas), cv2.line(canvas, (126, 82), (194, 158), 200, 14),
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_no_h_is_not_found(name: str) -> None:
    image, light = letter(OTHERS[name]), len(name) % 2 == 1
    noise = np.random.default_rng(6).normal(0.0, 3.0, image.shape)
    picture = np.clip((image if light else 255 - image) + noise, 0, 255).astype(np.uint8)
    assert AnyHFrontEnd(CAMERA, MOUNT, 1.0).see(picture, quaternion(0.0, 0.0, 0.0)) is None


def test_nothing_is_found_in_nothing() -> None:
    rng = np.random.default_rng(7)
    front_end = AnyHFrontEnd(CAMERA, MOUNT, 1.0)
    clutter = cv2.GaussianBlur(rng.standard_normal((240, 320)), (0, 0), 5.0)
    for image in (
        np.zeros((240, 320)),
        rng.normal(100, 30, (240, 320)),
        128 + 60 * clutter / clutter.std(),
    ):
        assert front_end.see(np.clip(image, 0, 255).astype(np.uint8), quaternion(0.0, 0.0, 0.0)) is None


# the kernels

RAYS = np.random.default_rng(8).uniform(-0.1, 0.1, (60, 2))
TO_MARK = np.array([[9.0, 0.3, 0.02], [0.2, -9.0, 0.05], [0.1, 0.05, 1.0]])
SWEEP, SIZES, SIGMAS = np.array([0.01, -0.02]), np.array([0.9, 1.0, 0.2]), np.array([0.05, 0.06])


@pytest.mark.parametrize("column", range(7))
def test_the_appearance_has_its_derivatives(column: int) -> None:
    step = 1e-6
    shift = np.eye(3)
    sizes, sigmas = SIZES.copy(), SIGMAS.copy()
    if column < 2:
        shift[column, 2] = step
    elif column in (4, 5):
        sizes[0 if column == 4 else 2] += step
    elif column == 6:
        sigmas = sigmas * (1.0 + step)
    if column in (2, 3):  # moved along the sweep: a second sweep in mark axes
        values = [_moving(sign * step, column - 2) for sign in (1, -1)]
        numeric = (values[0] - values[1]) / (2 * step)
    else:
        moved, _ = appearance(RAYS, shift @ TO_MARK, SWEEP, 5, sizes, sigmas)
        numeric = (moved - appearance(RAYS, TO_MARK, SWEEP, 5, SIZES, SIGMAS)[0]) / step
    exact = appearance(RAYS, TO_MARK, SWEEP, 5, SIZES, SIGMAS)[1][:, column]
    np.testing.assert_allclose(numeric, exact, atol=1e-3 * max(np.abs(exact).max(), 1e-3))


def _moving(step: float, axis: int) -> np.ndarray:
    """Mean over the sweep's points, each moved by its place along it."""
    total = np.zeros(len(RAYS))
    for f in (np.arange(5) + 0.5) / 5 - 0.5:
        shift = np.eye(3)
        shift[axis, 2] = f * step
        total += appearance(RAYS + f * SWEEP, shift @ TO_MARK, np.zeros(2), 1, SIZES, SIGMAS)[0]
    return total / 5


def test_the_parts_make_up_the_mark() -> None:
    whole, _ = appearance(RAYS, TO_MARK, SWEEP, 5, SIZES, SIGMAS)
    np.testing.assert_allclose(parts(RAYS, TO_MARK, SWEEP, 5, SIZES, SIGMAS)[:, :5].sum(axis=1), whole, atol=1e-6)
    same = np.empty(len(RAYS))
    share(RAYS, TO_MARK, SWEEP, 5, SIZES, SIGMAS, same)
    np.testing.assert_allclose(same, whole, atol=1e-6)


def test_the_sharp_appearance_is_the_area_covered(painter: Any) -> None:
    """Against area coverage of a pixel's square, whose blur has a variance of a twelfth."""
    mark, q = HMark(1.0, 0.9, 0.2), quaternion(0.0, 0.0, 0.0)
    level, pose = level_axes(q, MOUNT), MarkPose(np.array([0.05, 0.02, 4.0]), 0.0)
    covered = cv2.GaussianBlur(painter.coverage(CAMERA, pose, level, mark), (0, 0), 1.5)
    rows, columns = np.mgrid[60:180, 100:220]
    rays = CAMERA.rays(np.column_stack([columns.ravel(), rows.ravel()]).astype(float))[:, :2]
    to_mark = np.linalg.inv(np.column_stack([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], pose.position]))
    sigma = math.sqrt(1.5**2 + 1 / 12) * 4.0 / CAMERA.fx
    values, _ = appearance(np.ascontiguousarray(rays), to_mark, np.zeros(2), 1, np.array([0.9, 1.0, 0.2]),
                           np.full(2, sigma))  # fmt: skip
    np.testing.assert_allclose(values, covered[rows, columns].ravel(), atol=0.02)


def test_the_table_of_edges_is_the_outline() -> None:
    mark = HMark(1.0, 0.8, 0.15)
    outline = mark.outline()
    sides = np.roll(outline, -1, axis=0) - outline
    quarters = np.rint(np.arctan2(sides[:, 1], sides[:, 0]) / (math.pi / 2)).astype(int) % 4
    np.testing.assert_array_equal(quarters, QUARTERS)
    across = np.where(quarters % 2 == 0, outline[:, 1], outline[:, 0])
    np.testing.assert_allclose(PLACES @ [mark.width, mark.leg, mark.stroke], across)
