"""The ring mark's front end on synthetic pictures with known truth."""

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimators.vision.pose import LevelAxes, MarkPose, directions, from_pad_plane, level_axes, on_pad_plane, place
from estimators.vision.ring_mark import RingFrontEnd
from estimators.vision.ring_samples import ring_samples
from estimators.vision.ring_search import fit_circle
from estimators.vision.sighting import PadPrediction, PadSighting
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import Disc, HMark, Mark, RingMark
from flightlog.rotations import from_vector, matrix, multiply, quaternion, wrap

CAMERA = CameraModel.centred(768, 494, 952.4, 816.3)
MOUNT = CameraMount.downward(np.zeros(3))
MARK = RingMark()
GREY = {"white": 190.0, "grey": 120.0, "black": 40.0}
DECK = 65.0
SUB = 6


def tones(points: np.ndarray, mark: Mark) -> np.ndarray:
    """Grey levels (N,) at points (N, 2) [m] of the mark's plane: painted in order, as `shapes` says."""
    x, y = points.T
    on = np.maximum(np.abs(x), np.abs(y)) <= mark.square / 2
    grey = np.where(on, GREY["black"], DECK)
    for shape in mark.shapes():
        if isinstance(shape, Disc):
            near = np.flatnonzero(np.abs(x - shape.x) < shape.radius)
            inside = near[np.hypot(x[near] - shape.x, y[near] - shape.y) < shape.radius]
        else:
            corners = np.array(shape.corners)
            near = np.flatnonzero((np.abs(x - corners[:, 0].mean()) < 1.0) & on)
            odd = np.zeros(len(near), bool)
            for (x0, y0), (x1, y1) in zip(shape.corners, np.roll(corners, -1, axis=0), strict=True):
                if x0 == x1:  # even-odd rule along +x
                    odd ^= (x[near] < x0) & (y[near] >= min(y0, y1)) & (y[near] < max(y0, y1))
            inside = near[odd]
        grey[inside] = GREY[shape.tone]
    return grey


def paint(pose: MarkPose, level: LevelAxes, rng: np.random.Generator, mark: Mark, noise: float, blur: float):
    """A picture (H, W): SUB x SUB rays in each pixel that an edge may cross, blurred, with noise."""
    axes = np.stack(directions(pose, level), axis=1)

    def shown(pixels: np.ndarray) -> np.ndarray:
        rays = CAMERA.rays(pixels)
        arms = rays * ((pose.position @ level.up) / (rays @ level.up))[:, None] - pose.position
        return tones(arms @ axes, mark)

    columns, rows = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    grey = shown(np.column_stack([columns.ravel(), rows.ravel()]).astype(float)).reshape(rows.shape)
    crossed = np.argwhere(cv2.morphologyEx(grey, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > 0)
    sub = (np.arange(SUB) + 0.5) / SUB - 0.5
    within = np.stack(np.meshgrid(sub, sub), axis=-1).reshape(1, -1, 2)
    fine = shown((crossed[:, None, ::-1] + within).reshape(-1, 2))
    grey[crossed[:, 0], crossed[:, 1]] = fine.reshape(len(crossed), -1).mean(axis=1)
    grey = cv2.GaussianBlur(grey, (0, 0), blur) + rng.normal(0.0, noise, grey.shape)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class Shot:
    image: np.ndarray
    attitude: np.ndarray
    level: LevelAxes
    pose: MarkPose

    def prediction(self, rng: np.random.Generator, std: float = 0.01, std_angle: float = 0.01) -> PadPrediction:
        return PadPrediction(
            self.pose.position + rng.normal(0, std, 3), self.pose.angle + rng.normal(0, std_angle),
            np.full(3, std), std_angle,
        )  # fmt: skip

    def error(self, seen: PadSighting) -> np.ndarray:
        """Error (4,) of x, y, z [m] and angle [rad]."""
        return np.append(seen.position - self.pose.position, wrap(seen.angle - self.pose.angle))


@cache
def shoot(
    height: float, seed: int, *, tilt: float = 0.08, stray: float = 0.2, mark: Mark = MARK, noise: float = 3.0,
    blur: float = 0.7,
) -> Shot:  # fmt: skip
    """The mark somewhere within `stray` of the picture's half size about its centre, turned anyhow."""
    rng = np.random.default_rng(seed)
    attitude = quaternion(*rng.uniform(-tilt, tilt, 2), rng.uniform(0, 2 * math.pi))
    level = level_axes(attitude, MOUNT)
    pixel = np.array([CAMERA.cx, CAMERA.cy]) * (1.0 + rng.uniform(-stray, stray, 2))
    right, forward = on_pad_plane(pixel, CAMERA, level)[0]
    pose = MarkPose(from_pad_plane(right, forward, height, level), rng.uniform(-math.pi, math.pi))
    return Shot(paint(pose, level, rng, mark, noise, blur), attitude, level, pose)


def ideal(**other: Any) -> RingFrontEnd:
    """A front end that is told that attitude, lens and mark are exactly known."""
    return RingFrontEnd(CAMERA, MOUNT, MARK, **({"tilt_std": 1e-6, "scale_std": 0.0, "pixel_std": 0.0} | other))


def seen_by(front_end: RingFrontEnd, shot: Shot, prediction: PadPrediction | None) -> PadSighting:
    seen = front_end.see(shot.image, shot.attitude, prediction)
    assert seen is not None
    return seen


def within(shot: Shot, seen: PadSighting, sigmas: float = 5.0) -> bool:
    return bool(np.all(np.abs(shot.error(seen)) <= sigmas * np.sqrt(np.diag(seen.covariance))))


@pytest.mark.parametrize("height", [14.0, 8.0, 4.0, 2.6])
def test_a_mark_is_found_without_any_knowledge_whichever_way_it_is_turned(height):
    for seed in range(2):
        shot = shoot(height, seed)
        seen = seen_by(RingFrontEnd(CAMERA, MOUNT, MARK), shot, None)
        assert seen.source == "acquired"
        assert within(shot, seen), shot.error(seen)
        assert -math.pi < seen.angle <= math.pi
        assert np.abs(shot.error(seen)[:2]).max() < 3e-4 * height
        assert abs(shot.error(seen)[3]) < 1e-3


@pytest.mark.parametrize("height", [6.0, 1.6, 1.0, 0.6, 0.35, 0.18])
def test_a_mark_is_followed_down_to_the_ground(height):
    for seed in range(1):
        shot, rng = shoot(height, seed), np.random.default_rng(seed)
        std = 0.002 + 0.002 * height
        seen = seen_by(RingFrontEnd(CAMERA, MOUNT, MARK), shot, shot.prediction(rng, std))
        assert seen.source == ("tracked" if height > 5.0 else "cut")
        assert within(shot, seen), shot.error(seen)
        assert np.abs(shot.error(seen)[:3]).max() < 1e-3 * height
        assert abs(shot.error(seen)[3]) < 2e-3


def test_some_of_the_bars_are_enough_for_the_angle():
    told = 0
    for seed in range(6):
        shot = shoot(2.0, 40 + seed, stray=0.3)
        seen = seen_by(RingFrontEnd(CAMERA, MOUNT, MARK), shot, None)
        assert seen.visible < 1.0
        assert math.isnan(seen.angle) or abs(shot.error(seen)[3]) < 1e-3
        told += math.isfinite(seen.angle)
    assert told >= 4


@pytest.mark.parametrize("height", [0.9, 0.5])
def test_rings_alone_give_the_place_and_leave_the_angle_open(height):
    shot = shoot(height, 4)
    seen = seen_by(RingFrontEnd(CAMERA, MOUNT, MARK), shot, None)
    assert np.abs(shot.error(seen)[:3]).max() < 1e-3 * height
    assert math.isnan(seen.angle) and seen.std_angle > 1.0


def test_the_centre_of_the_imaged_ellipse_is_not_taken_for_the_ring_s():
    """At a tilt of 15 deg, from 2 m: the ellipse's centre is millimetres off, the answer is not."""
    rng = np.random.default_rng(0)
    attitude = quaternion(math.radians(15.0), 0.0, 0.3)
    level = level_axes(attitude, MOUNT)
    right, forward = on_pad_plane(np.array([CAMERA.cx, CAMERA.cy]), CAMERA, level)[0]
    pose = MarkPose(from_pad_plane(right, forward, 2.0, level), 1.0)
    turn = np.linspace(0, 2 * math.pi, 400, endpoint=False)
    rim = CAMERA.project(place(0.5 * np.column_stack([np.cos(turn), np.sin(turn)]), pose, level))
    (u, v), _, _ = cv2.fitEllipseDirect(rim.astype(np.float32))
    off = np.array([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy]) * pose.position[2]
    assert np.hypot(*(off - pose.position[:2])) > 0.01
    seen = seen_by(ideal(), Shot(paint(pose, level, rng, MARK, 2.0, 0.7), attitude, level, pose), None)
    assert np.hypot(*(seen.position - pose.position)[:2]) < 2e-4


@pytest.mark.parametrize("height", [8.0, 2.6])
def test_the_stated_covariance_is_that_of_the_errors(height):
    squared = []
    for seed in range(8):
        shot = shoot(height, 100 + seed, tilt=0.05, noise=5.0)
        seen = seen_by(ideal(), shot, shot.prediction(np.random.default_rng(seed), 0.005, 0.005))
        error = shot.error(seen)
        squared.append(error @ np.linalg.solve(seen.covariance, error))
    # noise floor and pixels shared by neighbouring edge points are reckoned with: never too sure, nor half as sure
    assert 0.15 * 4 < np.mean(squared) < 2.0 * 4


def test_perspective_shows_what_the_attitude_is_wrong_by():
    for seed, slip in enumerate(([0.012, 0.0, 0.0], [0.0, -0.009, 0.0], [-0.006, 0.006, 0.0])):
        shot = shoot(3.5, 20 + seed, tilt=0.04)
        told = multiply(shot.attitude, from_vector(np.array(slip)))
        seen = RingFrontEnd(CAMERA, MOUNT, MARK).see(shot.image, told, None)
        assert seen is not None and seen.level is not None
        up = shot.level.up
        told_up = (matrix(told) @ MOUNT.axes).T @ [0.0, 0.0, 1.0]
        assert np.linalg.norm(told_up - up) > 0.008
        off = seen.level.up - up
        assert np.linalg.norm(off) < 0.0015
        assert np.all(np.abs(off) < 5.0 * np.sqrt(np.diag(seen.level.covariance)) + 1e-9)


def test_from_high_above_perspective_shows_no_tilt_worth_telling():
    front_end, shot = RingFrontEnd(CAMERA, MOUNT, MARK), shoot(14.0, 0)
    near = seen_by(front_end, shoot(2.6, 0), None)
    assert near.level is not None
    far = seen_by(front_end, shot, None).level
    assert far is None or np.trace(far.covariance) > 100.0 * np.trace(near.level.covariance)


def test_a_mistaken_filter_is_set_right():
    shot = shoot(5.0, 1)
    mistaken = PadPrediction(shot.pose.position + [0.5, -0.4, 0.6], shot.pose.angle + 2.0, np.full(3, 0.01), 0.01)
    seen = seen_by(RingFrontEnd(CAMERA, MOUNT, MARK), shot, mistaken)
    assert seen.source == "acquired"
    assert within(shot, seen)


@pytest.mark.parametrize("height", [8.0, 2.6])
def test_half_the_rings_may_be_hidden_from_a_mark_that_is_followed(height):
    front_end = RingFrontEnd(CAMERA, MOUNT, MARK)
    for seed in range(2):
        shot, rng = shoot(height, seed), np.random.default_rng(seed)
        image = shot.image.copy()
        corner = np.array([[-0.1, -1.0], [-0.1, 0.2], [-1.0, 0.2], [-1.0, -1.0]])
        cover = CAMERA.project(place(corner, shot.pose, shot.level))
        cv2.fillPoly(image, [np.rint(cover).astype(np.int32)], 90)
        seen = front_end.see(image, shot.attitude, shot.prediction(rng, 0.004 + 0.001 * height, 0.005))
        assert seen is not None
        assert within(shot, seen), shot.error(seen)


def test_nothing_is_found_where_there_is_no_ring_mark():
    front_end = RingFrontEnd(CAMERA, MOUNT, MARK)
    empty = np.random.default_rng(0).normal(90, 25, (CAMERA.height, CAMERA.width))
    assert front_end.see(np.clip(cv2.GaussianBlur(empty, (0, 0), 2) * 4 - 270, 0, 255).astype(np.uint8),
                         quaternion(0, 0, 0), None) is None  # fmt: skip
    shot = shoot(4.0, 2, mark=HMark())
    assert front_end.see(shot.image, shot.attitude, None) is None
    assert front_end.see(shot.image, shot.attitude, shot.prediction(np.random.default_rng(0))) is None


@pytest.mark.parametrize("radii", [(0.5, 0.25), (0.5, 0.44, 0.3, 0.1), (0.5, 0.38)])
def test_rings_in_other_proportions_are_not_the_mark_s(radii):
    """Bull's eyes on a black square: circles about one centre, but neither the mark's nor with bars around them."""
    image = np.full((CAMERA.height, CAMERA.width), 65, np.uint8)
    centre, scale = (380, 250), 150.0
    cv2.rectangle(image, (180, 50), (580, 450), 40, -1)
    for k, radius in enumerate(radii):
        axes = (round(radius * scale), round(radius * scale * CAMERA.fy / CAMERA.fx))
        cv2.ellipse(image, centre, axes, 0, 0, 360, 190 if k % 2 == 0 else 40, -1, cv2.LINE_AA)
    blurred = cv2.GaussianBlur(image, (0, 0), 0.8).astype(np.uint8)
    assert RingFrontEnd(CAMERA, MOUNT, MARK).see(blurred, quaternion(0, 0, 0), None) is None


def test_edge_normals_point_from_light_to_dark():
    samples = ring_samples(MARK).samples
    step = 1e-4 * samples.normals
    assert np.all(tones(samples.points - step, MARK) > tones(samples.points + step, MARK))


@given(
    x=st.floats(-2, 2), y=st.floats(-2, 2), radius=st.floats(0.1, 3), start=st.floats(0, 6.28),
    arc=st.floats(1.0, 6.28),
)  # fmt: skip
@settings(max_examples=50, deadline=None)
def test_a_circle_is_found_from_any_arc_of_it(x, y, radius, start, arc):
    angle = start + np.linspace(0, arc, 40)
    points = np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])
    np.testing.assert_allclose(fit_circle(points), (x, y, radius), atol=1e-6 * radius + 1e-9, rtol=1e-6)


def test_pictures_of_another_size_and_unknown_variants_are_refused():
    with pytest.raises(ValueError, match="picture: 10x20, the camera has 768x494"):
        RingFrontEnd(CAMERA, MOUNT, MARK).see(np.zeros((20, 10), np.uint8), quaternion(0, 0, 0))
    with pytest.raises(ValueError, match="variant"):
        RingFrontEnd(CAMERA, MOUNT, MARK, variant="imaginary")  # type: ignore[arg-type]
