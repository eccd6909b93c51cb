"""Optical flow on drawn ground whose motion is known exactly."""

import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import fourier_shift, gaussian_filter

from estimators.flow_inertial import velocity_between
from estimators.vision import sad
from estimators.vision.flow import KeyFrameFlowEye
from estimators.vision.integer_flow import IntegerFlowEye
from estimators.zeng_navigator import velocity_over_ground
from flightlog.camera import CameraModel, CameraMount
from flightlog.rotations import from_vector, matrix, multiply, quaternion
from flightlog.signals import FlowSample, Frame

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

CAMERA = CameraModel.centred(384, 248, 480.0, 410.0)
MOUNT = CameraMount.downward(np.zeros(3))
SIDE, GRAIN = 1536, 0.0012  # texels, [m] each


@pytest.fixture(scope="module")
def ground() -> Image:
    """Grit on paving, periodic."""
    rng = np.random.default_rng(5)
    fields = [gaussian_filter(rng.standard_normal((SIDE, SIDE)), s, mode="wrap") for s in (2, 8)]
    picture = 110 + sum(14.0 * field / field.std() for field in fields)
    return np.clip(picture, 0, 255).astype(np.uint8)


def view(ground: Image, position: Floats, attitude: Floats, rng: np.random.Generator | None = None) -> Image:
    """What CAMERA sees from a position (3,) [m] ENU with an attitude (4,) wxyz; (0, 0) is the middle texel."""
    turn = matrix(attitude) @ MOUNT.axes
    # ground (e, n, 1) to the picture: K R' [e - x, n - y, -z]
    to_picture = CAMERA.matrix @ turn.T @ np.array([[1, 0, -position[0]], [0, 1, -position[1]], [0, 0, -position[2]]])
    middle = (SIDE - 1) / 2
    to_ground = np.array([[GRAIN, 0, -middle * GRAIN], [0, -GRAIN, middle * GRAIN], [0, 0, 1]])  # texels to metres
    flags = cv2.INTER_AREA | cv2.INTER_LINEAR
    picture = cv2.warpPerspective(ground, to_picture @ to_ground, (CAMERA.width, CAMERA.height), flags=flags)
    if rng is not None:
        picture = np.clip(np.rint(picture + 2.0 * rng.standard_normal(picture.shape)), 0, 255)
    return np.asarray(picture, np.uint8)


def true_motion(first: tuple[Floats, Floats], second: tuple[Floats, Floats]) -> Floats:
    """(u, v): where the second camera sees what was straight ahead of the first; each position and attitude."""
    (p, q), (p_2, q_2) = first, second
    ahead = (matrix(q) @ MOUNT.axes)[:, 2]
    there = (matrix(q_2) @ MOUNT.axes).T @ (p - ahead * p[2] / ahead[2] - p_2)
    return there[:2] / there[2]


# block matching


def test_blocks_are_found_where_they_went_whole_pixels_exactly(ground: Image) -> None:
    first = ground[:200, :300]
    corners = np.array([(60, 50), (120, 80), (200, 150)])
    for i, j in ((0, 0), (3, -2), (-4, 4)):
        second = np.roll(first, (j, i), axis=(0, 1))
        found = sad.match(first, second, corners, 8, 4)
        assert np.array_equal(found[:, :3], [(i, j, 0)] * 3)
        np.testing.assert_allclose(sad.refine(found), 0.0, atol=0.25)


def test_it_is_the_sum_of_absolute_differences(ground: Image) -> None:
    """Against numpy, every one of the sums."""
    first, second = ground[:40, :40], ground[3:43, 5:45]
    (dx, dy, least, left, right, above, below), *_ = sad.match(first, second, np.array([(12, 14)]), 8, 6).tolist()

    def total(i: int, j: int) -> int:
        block = first[14:22, 12:20].astype(int)
        return int(np.abs(block - second[14 + j : 22 + j, 12 + i : 20 + i]).sum())

    sums = {(i, j): total(i, j) for i in range(-6, 7) for j in range(-6, 7)}
    assert least == min(sums.values()) == sums[dx, dy]
    assert [left, right, above, below] == [total(dx - 1, dy), total(dx + 1, dy), total(dx, dy - 1), total(dx, dy + 1)]


def test_parts_of_a_pixel_by_the_v_are_nearer_than_by_a_parabola(ground: Image) -> None:
    first = ground[:256, :256].astype(float)
    corners = np.stack(np.meshgrid(np.arange(32, 216, 16), np.arange(32, 216, 16)), -1).reshape(-1, 2)
    errors: dict[str, list[float]] = {"v": [], "parabola": [], "whole": []}
    for shift in (0.2, 0.35, 0.6, 0.8):
        moved = np.fft.ifft2(fourier_shift(np.fft.fft2(np.roll(first, 0)), (0.0, shift))).real
        found = sad.match(first.astype(np.uint8), np.clip(np.rint(moved), 0, 255).astype(np.uint8), corners, 16, 3)
        least, left, right = found[:, 2], found[:, 3], found[:, 4]
        parabola = 0.5 * (left - right) / np.maximum(left + right - 2.0 * least, 1.0)
        errors["v"] += [float(np.mean(found[:, 0] + sad.refine(found)[:, 0]) - shift)]
        errors["parabola"] += [float(np.mean(found[:, 0] + parabola) - shift)]
        errors["whole"] += [float(np.mean(found[:, 0]) - shift)]
    rms = {name: float(np.sqrt(np.mean(np.square(values)))) for name, values in errors.items()}
    assert rms["v"] < 0.06
    assert rms["v"] < 0.7 * rms["parabola"]
    assert rms["v"] < 0.3 * rms["whole"]


def test_a_plain_block_has_no_texture_and_stripes_have_none_along_them(ground: Image) -> None:
    corners = np.array([(8, 8)])
    assert sad.texture(np.full((32, 32), 90, np.uint8), corners, 16)[0] == 0.0
    stripes = np.tile(np.array([60, 60, 160, 160], np.uint8), (32, 8))
    assert sad.texture(stripes, corners, 16)[0] == 0.0
    assert sad.texture(ground[:32, :32], corners, 16)[0] > 2.0


# key frames


def fly_over(ground: Image, eye: KeyFrameFlowEye | IntegerFlowEye, poses: list[tuple[Floats, Floats]]) -> Floats:
    """Rows of t, dt, u, v, error of u and v against the truth."""
    rng = np.random.default_rng(3)
    rows = []
    for k, pose in enumerate(poses):
        s = eye.see(Frame(0.04 * k, 0.04 * k, "down", view(ground, *pose, rng)))
        if s is not None and s.quality > 0.0:
            key = poses[round((s.t - s.dt) / 0.04)]
            rows.append([s.t, s.dt, s.u, s.v, *(np.array([s.u, s.v]) - true_motion(key, pose))])
    return np.array(rows)


def hover(count: int) -> list[tuple[Floats, Floats]]:
    """A restless hover at 0.9 m: it wanders some centimetres, tilts and turns some degrees."""
    t = 0.04 * np.arange(count)
    place = np.stack([0.05 * np.sin(0.7 * t), 0.04 * np.sin(0.5 * t + 1.0), 0.9 + 0.01 * np.sin(0.9 * t)], axis=1)
    turns = (0.05 * np.sin(1.1 * t), 0.04 * np.sin(1.4 * t), 0.05 * np.sin(0.3 * t))
    return [(p, quaternion(*angles)) for p, angles in zip(place, np.transpose(turns).tolist(), strict=True)]


def test_since_one_key_frame_the_motion_is_known_to_a_tenth_of_a_pixel_for_ever(ground: Image) -> None:
    rows = fly_over(ground, KeyFrameFlowEye(CAMERA), hover(90))
    assert len(rows) == 89
    np.testing.assert_allclose(rows[:, 0], rows[:, 1], atol=1e-9)  # all since the first picture
    pixels = rows[:, 4:] * [CAMERA.fx, CAMERA.fy]
    assert np.sqrt(np.mean(pixels**2)) < 0.06
    assert np.abs(pixels).max() < 0.25
    late, early = np.abs(pixels[-30:]).mean(), np.abs(pixels[:30]).mean()
    assert late < 2.0 * early


def test_under_way_key_frames_follow_one_another_without_a_gap(ground: Image) -> None:
    poses = [(np.array([0.01 * k - 0.3, 0.0, 0.9]), quaternion(0.0, 0.0, 0.0)) for k in range(60)]
    rows = fly_over(ground, KeyFrameFlowEye(CAMERA), poses)
    keys = np.unique(np.round(rows[:, 0] - rows[:, 1], 6))
    assert 1 < len(keys) < 10
    assert np.all(np.isin(keys, np.round(np.append(rows[:, 0], 0.0), 6))), "a key frame was itself compared"
    assert np.abs(rows[:, 4:] * [CAMERA.fx, CAMERA.fy]).max() < 0.3


def test_a_shadow_that_moves_along_loses_the_vote(ground: Image) -> None:
    """A quarter of the picture goes with the vehicle; the ground moves 2 px, so that both are found."""
    eye = KeyFrameFlowEye(CAMERA)
    for k, x in enumerate((0.0, 0.004)):
        picture = view(ground, np.array([x, 0.0, 0.9]), quaternion(0.0, 0.0, 0.0)).astype(float)
        gauze = cv2.GaussianBlur(np.random.default_rng(9).standard_normal((124, 192)), (0, 0), 2.0)
        picture[:124, :192] = 70.0 + 60.0 * gauze / gauze.std() * 0.4
        s = eye.see(Frame(0.04 * k, 0.04 * k, "down", np.clip(picture, 0, 255).astype(np.uint8)))
    assert s is not None
    assert 0.5 < s.quality < 0.85
    np.testing.assert_allclose([s.u, s.v], [-0.004 / 0.9, 0.0], atol=0.15 / CAMERA.fx)


def test_where_there_is_nothing_to_match_it_says_so_and_goes_on(ground: Image) -> None:
    eye, poses = KeyFrameFlowEye(CAMERA), hover(30)
    blank = np.full((CAMERA.height, CAMERA.width), 120, np.uint8)
    answers = []
    for k, pose in enumerate(poses):
        picture = blank if 10 <= k < 13 else view(ground, *pose)
        answers.append(eye.see(Frame(0.04 * k, 0.04 * k, "down", picture)))
    assert answers[0] is None
    assert all(s is not None and s.quality == 0.0 and math.isnan(s.u) for s in answers[10:13])
    last = answers[-1]
    assert last is not None
    assert last.quality > 0.5
    assert last.dt == pytest.approx(29 * 0.04), "a short failure does not cost the key frame"
    assert KeyFrameFlowEye(CAMERA).see(Frame(0.0, 0.0, "down", blank)) is None


def test_whole_pixels_of_consecutive_pictures_do_not_see_a_slow_drift(ground: Image) -> None:
    """0.2 px a picture: the published matching says nothing moves, for ever."""
    poses = [(np.array([0.2 * 0.9 / CAMERA.fx * k, 0.0, 0.9]), quaternion(0.0, 0.0, 0.0)) for k in range(40)]
    published = fly_over(ground, IntegerFlowEye(CAMERA), poses)
    assert np.abs(published[:, 2].sum()) < 0.3 * 39 * 0.2 / CAMERA.fx
    ours = fly_over(ground, KeyFrameFlowEye(CAMERA), poses)
    assert ours[-1, 2] == pytest.approx(-39 * 0.2 / CAMERA.fx, abs=0.1 / CAMERA.fx)


def test_fast_motion_is_measured_in_whole_coarse_pixels(ground: Image) -> None:
    poses = [(np.array([4.0 * 0.9 / CAMERA.fx * k, 0.0, 0.9]), quaternion(0.0, 0.0, 0.0)) for k in range(12)]
    rows = fly_over(ground, IntegerFlowEye(CAMERA), poses)
    np.testing.assert_allclose(rows[:, 2] * CAMERA.fx, -4.0, atol=1e-9)
    np.testing.assert_allclose(rows[:, 1], 0.04, atol=1e-9)


# velocity


@pytest.mark.parametrize("rates", [(0.0, 0.0, 0.0), (0.3, -0.2, 0.4)])
@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.12, -0.08)])
def test_velocity_over_the_ground_is_exact_with_tilt_and_turning(rates, tilt) -> None:
    dt, velocity, height = 0.04, np.array([0.3, -0.2]), 1.1  # forward, left
    end = quaternion(*tilt, 0.7)
    start = multiply(end, from_vector(-dt * np.array(rates)))
    forward = np.array([math.sin(0.7), math.cos(0.7)])
    world = velocity[0] * forward + velocity[1] * np.array([-forward[1], forward[0]])
    place = np.array([0.0, 0.0, height])
    u, v = true_motion((place, start), (place + dt * np.append(world, 0.0), end))
    sample = FlowSample(dt, dt, dt, float(u), float(v), 1.0)
    got = velocity_between(sample, MOUNT, end, np.array(rates), height)
    np.testing.assert_allclose(got, velocity, atol=1e-9)
    if tilt == (0.0, 0.0):
        right, down = velocity_over_ground(sample.u, sample.v, dt, MOUNT.axes.T @ np.array(rates), height)
        np.testing.assert_allclose([-down, -right], velocity, atol=0.006)  # the paper's first order
    with pytest.raises(ValueError, match="ground"):
        velocity_between(sample, MOUNT, quaternion(1.6, 0.0, 0.0), np.zeros(3), height)
