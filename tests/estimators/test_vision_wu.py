"""Wu 2019's front end and the ring's pose by ellipse and orthogonal iteration, on drawn pictures of known truth."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimators.vision.ellipse import Circle
from estimators.vision.pose import level_axes
from estimators.vision.ring_pose import RingPoseFrontEnd
from estimators.vision.roi import region
from estimators.vision.sighting import PadPrediction
from estimators.vision.wu_features import find_ring, order_corners, prepare
from estimators.vision.wu_mark import WuFrontEnd
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import RingMark
from flightlog.rotations import matrix, quaternion
from scenarios.experiments.drawn_pad import DrawnPad

cv2.setNumThreads(1)
CAMERA, MOUNT, MARK = CameraModel.centred(768, 494, 952.4, 816.3), CameraMount.downward(np.zeros(3)), RingMark()
PAD = DrawnPad(MARK, CAMERA, MOUNT)


class Look:
    """One picture from `height` [m] with its truth; the mark lies near the picture's middle."""

    def __init__(self, seed, height, tilt=0.035, heading=None):
        self.rng = rng = np.random.default_rng(seed)
        turned = rng.uniform(0, 2 * math.pi) if heading is None else heading
        self.attitude = quaternion(*rng.normal(0, tilt, 2), turned)
        axes = matrix(self.attitude) @ MOUNT.axes
        self.position = np.append(rng.uniform(-0.03, 0.03, 2) * height, height)
        self.position[:2] -= axes[:2, 2] * height
        self.image = PAD.picture(self.position, self.attitude, np.zeros(3), np.zeros(3), rng)
        self.true = -axes.T @ self.position
        north, level = axes.T @ [0.0, 1.0, 0.0], level_axes(self.attitude, MOUNT)
        self.angle = math.atan2(north @ level.right, north @ level.forward)

    def off(self, seen):
        """Errors of place (3,) [m] and of the angle [rad]."""
        return seen.position - self.true, math.remainder(seen.angle - self.angle, 2 * math.pi)


@pytest.mark.parametrize("height", [3.0, 5.0, 7.0])
def test_position_and_heading_are_as_good_as_the_paper_says(height):
    """X, Y and Z within 0.1 m, heading within 1 deg (section 4), with the attitude used."""
    eye = WuFrontEnd(CAMERA, MOUNT, MARK, exact=True)
    for seed in range(6):
        look = Look(seed, height)
        place, angle = look.off(eye.see(look.image, look.attitude))
        assert np.all(np.abs(place[:2]) < 0.02)
        assert abs(place[2]) < 0.12
        assert abs(math.degrees(angle)) < 0.5


def test_a_tilt_taken_for_none_moves_the_mark_by_its_height():
    """Section 3.1 takes roll and pitch for zero: 3 deg at 5 m are 0.26 m over the ground."""
    look = Look(1, 5.0, tilt=0.0, heading=0.0)
    tilted = quaternion(math.radians(3.0), 0.0, 0.0)
    axes = matrix(tilted) @ MOUNT.axes
    image = PAD.picture(look.position, tilted, np.zeros(3), np.zeros(3), look.rng)
    flat = matrix(quaternion(0.0, 0.0, 0.0)) @ MOUNT.axes
    level = WuFrontEnd(CAMERA, MOUNT, MARK).see(image, tilted)
    exact = WuFrontEnd(CAMERA, MOUNT, MARK, exact=True).see(image, tilted)
    assert np.linalg.norm((-flat @ level.position - look.position)[:2]) == pytest.approx(0.26, abs=0.03)
    assert np.linalg.norm((-axes @ exact.position - look.position)[:2]) < 0.02


@pytest.mark.parametrize("height", [0.3, 0.6, 1.0, 1.4])
def test_close_to_the_ground_smaller_rings_go_on(height):
    eye = WuFrontEnd(CAMERA, MOUNT, MARK, exact=True)
    for seed in range(3):
        look = Look(seed, height)
        seen = eye.see(look.image, look.attitude)
        place, _ = look.off(seen)
        assert np.all(np.abs(place) < 0.01 * height + 0.002)
        assert math.isnan(seen.angle)


def test_nothing_is_found_where_there_is_no_ring():
    bare = DrawnPad(MARK, CAMERA, MOUNT)
    rng = np.random.default_rng(0)
    eyes = [WuFrontEnd(CAMERA, MOUNT, MARK, exact=True), RingPoseFrontEnd(CAMERA, MOUNT, MARK)]
    for k in range(4):
        away = np.array([4.5, 6.0 - 3.0 * k, 4.0])  # the deck beside the pad
        attitude = quaternion(0.0, 0.0, 0.3 * k)
        image = bare.picture(away, attitude, np.zeros(3), np.zeros(3), rng)
        assert all(eye.see(image, attitude) is None for eye in eyes)
    discs = np.full((494, 768), 60, np.uint8)
    for k in range(5):
        cv2.circle(discs, (80 + 140 * k, 240), 30 + 8 * k, 220, -1)
        cv2.circle(discs, (80 + 140 * k, 240), 15 + 3 * k, 60, -1)
    assert all(eye.see(discs, np.array([1.0, 0, 0, 0])) is None for eye in eyes)


@given(st.floats(-3.1, 3.1), st.floats(0.02, 0.3), st.integers(0, 1000))
def test_corners_are_told_apart_whatever_the_heading(angle, scale, seed):
    """In any order of detection, with some of them missing, jitter and strangers among them."""
    rng = np.random.default_rng(seed)
    model = MARK.t_corners()
    c, s = math.cos(angle), math.sin(angle)
    centre = np.array([0.1, -0.05])
    plane = centre + scale * model @ np.array([[c, -s], [s, c]])
    plane += rng.normal(0, 0.004 * scale, plane.shape)
    seen = np.sort(rng.permutation(16)[: rng.integers(9, 17)])
    strangers = centre + scale * rng.uniform(-1, 1, (6, 2))
    strangers = strangers[np.min(np.linalg.norm(strangers[:, None] - plane, axis=2), axis=1) > 0.15 * scale]
    order = rng.permutation(len(seen) + len(strangers))
    mixed = np.vstack([plane[seen], strangers])[order]
    which, found = order_corners(mixed, Circle(centre, 0.5 * scale, 0.0), 0.5, MARK)
    assert math.remainder(found - angle, 2 * math.pi) == pytest.approx(0.0, abs=0.05)
    expected = np.full(16, -1)
    expected[seen] = [int(np.flatnonzero(order == k)[0]) for k in range(len(seen))]
    np.testing.assert_array_equal(which, expected)


def test_the_ring_is_the_outer_edge_of_the_outermost():
    look = Look(3, 6.0)
    level = level_axes(look.attitude, MOUNT)
    from estimators.vision.pose import on_pad_plane

    contour, circle, radius = find_ring(prepare(look.image), lambda px: on_pad_plane(px, CAMERA, level), MARK)
    assert radius == 0.5
    assert circle.radius == pytest.approx(0.5 / 6.0, rel=0.01)
    assert len(contour) > 300


@pytest.mark.parametrize("height", [3.0, 6.0, 9.0])
def test_ellipse_and_orthogonal_iteration_are_as_good_as_they_say(height):
    eye = RingPoseFrontEnd(CAMERA, MOUNT, MARK)
    errors = []
    for seed in range(8):
        look = Look(20 + seed, height)
        seen = eye.see(look.image, look.attitude)
        place, angle = look.off(seen)
        errors.append([*place, angle])
        assert np.linalg.norm(place) < 0.004 * (height / 6.0) ** 2 + 0.001
        assert abs(math.degrees(angle)) < 0.1
        # the tilt comes out of the picture: no attitude is needed for it
        assert seen.up @ level_axes(look.attitude, MOUNT).up > math.cos(math.radians(0.25 * height))
    print(f"{height} m: RMS {1e3 * np.sqrt(np.mean(np.square(errors), axis=0))} mm, mrad")


def test_a_region_of_interest_finds_the_same():
    for build in (lambda roi: WuFrontEnd(CAMERA, MOUNT, MARK, exact=True, roi=roi),
                  lambda roi: RingPoseFrontEnd(CAMERA, MOUNT, MARK, roi=roi)):  # fmt: skip
        broad, narrow = build(False), build(True)
        for seed in range(4):
            look = Look(40 + seed, 8.0)
            told = PadPrediction(look.true + look.rng.normal(0, 0.05, 3), 0.0, np.full(3, 0.05), 1.0)
            first, second = broad.see(look.image, look.attitude), narrow.see(look.image, look.attitude, told)
            assert second.source == "tracked"
            # another threshold, so not to the last digit
            assert np.linalg.norm(first.position - second.position) < 0.05
            wrong = PadPrediction(look.true + [1.5, 1.0, 0.0], 0.0, np.full(3, 0.01), 1.0)
            assert narrow.see(look.image, look.attitude, wrong).source == "acquired"


def test_the_region_holds_the_mark_as_often_as_three_deviations_say():
    rng = np.random.default_rng(9)
    held = 0
    for _ in range(300):
        true = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(4, 10)])
        std = rng.uniform(0.01, 0.2, 3)
        box = region(CAMERA, PadPrediction(true + rng.normal(0, std), 0.0, std, 1.0), 0.96, blur=0.0)
        around = np.linspace(0, 2 * math.pi, 60)
        rim = true + 0.96 * np.column_stack([np.cos(around), np.sin(around), np.zeros(60)])
        pixels = CAMERA.project(rim)
        held += box is None or bool(
            np.all((pixels >= [box[0], box[1]]) & (pixels <= [box[2], box[3]]) | ~CAMERA.contains(pixels)[:, None])
        )
    assert held >= 0.985 * 300


def test_a_vague_prediction_has_no_region():
    assert region(CAMERA, PadPrediction(np.array([0, 0, 5.0]), 0.0, np.full(3, 1.5), 1.0), 1.0) is None
    assert region(CAMERA, PadPrediction(np.array([9.0, 0, 5.0]), 0.0, np.full(3, 0.1), 1.0), 0.5) is None
