"""Lei 2012's front end: what it takes for an H, and what height it makes of it."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimators.vision.front_ends import pad_eye
from estimators.vision.lei_height import HeightReading, height, length
from estimators.vision.lei_mark import LENGTH_STD, LeiFrontEnd, LeiReading
from estimators.vision.lei_match import others, value
from estimators.vision.moments import affine_invariants, central_moments
from estimators.vision.pose import MarkPose, level_axes, place, wrap_axis
from estimators.vision.sighting import PadPrediction
from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec, Equipment
from flightlog.marks import HMark
from flightlog.rotations import quaternion

CAMERA = CameraModel.centred(768, 494, 952.4, 816.3)
SQUARE_PIXELS = CameraModel.centred(768, 494, 880.0)
MOUNT = CameraMount.downward(np.zeros(3))
MARK = HMark()
LEVEL = quaternion(0.0, 0.0, 0.0)
H = MARK.outline()
BAR = np.array([(-0.15, -0.5), (0.15, -0.5), (0.15, 0.5), (-0.15, 0.5)])
BOX = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
TEE = np.array([(-0.1, -0.5), (0.1, -0.5), (0.1, 0.3), (0.5, 0.3), (0.5, 0.5), (-0.5, 0.5), (-0.5, 0.3), (-0.1, 0.3)])
PLUS = np.array(
    [(-0.1, -0.5), (0.1, -0.5), (0.1, -0.1), (0.5, -0.1), (0.5, 0.1), (0.1, 0.1), (0.1, 0.5), (-0.1, 0.5),
     (-0.1, 0.1), (-0.5, 0.1), (-0.5, -0.1), (-0.1, -0.1)]
)  # fmt: skip
DISC = 0.5 * np.column_stack([np.cos(np.linspace(0, 2 * np.pi, 90)), np.sin(np.linspace(0, 2 * np.pi, 90))])
FINE = 8


def drawn(
    shapes: list[tuple[np.ndarray, int]], pose: MarkPose, attitude: np.ndarray = LEVEL, *, noise: float = 2.0,
    ground: int = 90, camera: CameraModel = CAMERA, seed: int = 0,
) -> np.ndarray:  # fmt: skip
    """A picture of outlines (N, 2) [m] and their grey levels, one on the other; 8 x 8 samples a pixel around them."""
    level = level_axes(attitude, MOUNT)
    corners = [camera.project(place(outline, pose, level)) for outline, _ in shapes]
    everything = np.vstack(corners)
    low = np.clip(np.floor(everything.min(axis=0)).astype(int) - 4, 0, [camera.width, camera.height])
    high = np.clip(np.ceil(everything.max(axis=0)).astype(int) + 5, 0, [camera.width, camera.height])
    fine = np.full(((high - low)[::-1] * FINE), ground, np.uint8)
    for points, (_, tone) in zip(corners, shapes, strict=True):
        # the polygon's pixels are those whose centres it holds, so that it does not grow by half of one
        inside = np.zeros(fine.shape, np.uint8)
        cv2.fillPoly(inside, [np.rint(((points - low + 0.5) * FINE - 0.5) * 256).astype(np.int32)], 1, cv2.LINE_8, 8)
        fine[inside > 0] = tone
    picture = np.full((camera.height, camera.width), float(ground))
    patch = cv2.resize(fine.astype(np.float32), tuple((high - low).tolist()), interpolation=cv2.INTER_AREA)
    picture[low[1] : high[1], low[0] : high[0]] = patch
    picture = cv2.GaussianBlur(picture, (0, 0), 0.6) + np.random.default_rng(seed).normal(0, noise, picture.shape)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


PAD = [(1.5 * BOX, 35), (H, 190)]


def above(depth: float, angle: float = 0.3, x: float = 0.0, y: float = 0.0) -> MarkPose:
    return MarkPose(np.array([x, y, depth]), angle)


def contour_of(pose: MarkPose, attitude: np.ndarray, camera: CameraModel) -> np.ndarray:
    return camera.project(place(H, pose, level_axes(attitude, MOUNT)))


# height


def test_the_three_lengths_of_an_h() -> None:
    assert length(H, "side") == pytest.approx(1.0)
    assert length(H, "perimeter") == pytest.approx(4 * 1.0 + 2 * 1.0 - 2 * 0.2)
    assert length(H, "root_area") == pytest.approx(math.sqrt(0.52))
    assert length(HMark(width=0.8).outline(), "side") == pytest.approx(0.9)


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-0.25, 0.25), st.floats(-0.25, 0.25), st.floats(0, 6.28), st.floats(0, 3.14), st.floats(-0.1, 0.1),
    st.floats(0.8, 20.0), st.sampled_from(["side", "perimeter", "root_area"]),
)  # fmt: skip
def test_the_exact_form_is_right_for_any_tilt_and_place(
    roll: float, pitch: float, heading: float, angle: float, off: float, depth: float, kind: str
) -> None:
    attitude = quaternion(roll, pitch, heading)
    level = level_axes(attitude, MOUNT)
    pose = above(depth, angle, off * depth, -off * depth)
    reading = HeightReading(kind, "calibrated", "exact")  # type: ignore[arg-type]
    found = height(contour_of(pose, attitude, CAMERA), H, CAMERA, level, (roll, pitch), reading)
    assert found == pytest.approx(-pose.position @ level.up, rel=2e-5)


def test_equation_7_as_printed_is_right_on_the_axis_of_a_level_camera_only() -> None:
    reading = HeightReading("side", "calibrated", "printed")
    found = height(contour_of(above(10.0), LEVEL, CAMERA), H, CAMERA, level_axes(LEVEL, MOUNT), (0.0, 0.0), reading)
    assert found == pytest.approx(10.0, rel=1e-5)
    # hovering over the mark with the tilts of the published landing, the mark is off the axis
    tilt = math.radians(7.2), math.radians(4.56)
    attitude = quaternion(*tilt, 0.0)
    level = level_axes(attitude, MOUNT)
    pose = MarkPose(-10.0 * level.up, 0.3)
    found = height(contour_of(pose, attitude, CAMERA), H, CAMERA, level, tilt, reading)
    assert -0.35 < found - 10.0 < -0.20
    untilted = height(contour_of(pose, attitude, CAMERA), H, CAMERA, level, (0.0, 0.0), reading)
    assert found / untilted == pytest.approx(math.cos(tilt[0]) * math.cos(tilt[1]), rel=1e-9)


def test_one_f_for_pixels_that_are_not_square_makes_the_height_depend_on_the_heading() -> None:
    def spread(camera: CameraModel) -> float:
        level = level_axes(LEVEL, MOUNT)
        heights = [
            height(contour_of(above(10.0, a), LEVEL, camera), H, camera, level, (0.0, 0.0), HeightReading())
            for a in np.linspace(0, np.pi / 2, 19)
        ]
        return max(heights) - min(heights)

    assert spread(CAMERA) > 0.5
    assert spread(SQUARE_PIXELS) < 1e-3


# recognition


@pytest.mark.parametrize(
    "shapes",
    [[(BOX, 190)], [(DISC, 190)], [(PLUS, 190)], [(TEE, 190)], [(BAR, 190)],
     [(BOX, 190), (0.3 * BOX + [-0.22, -0.22], 35), (0.3 * BOX + [0.22, -0.22], 35), (0.3 * BOX + 0.22, 35),
      (0.3 * BOX + [-0.22, 0.22], 35)]],
    ids=["square", "disc", "plus", "T", "I", "window"],
)  # fmt: skip
@pytest.mark.parametrize("depth", [4.0, 9.0, 14.0])
def test_nothing_but_an_h_is_taken_for_one(shapes: list[tuple[np.ndarray, int]], depth: float) -> None:
    eye = LeiFrontEnd(CAMERA, MOUNT, MARK)
    for angle in (0.0, 0.4, 0.9):
        assert eye.find(drawn([(1.5 * BOX, 35), *shapes], above(depth, angle))) is None
    assert eye.find(drawn(PAD, above(depth, 0.4))) is not None


def test_the_printed_invariants_of_an_h_are_noise() -> None:
    """sgn(I) lg|I| of I2 and I3, which vanish: even the H itself is decades away from its template."""
    eye = LeiFrontEnd(CAMERA, MOUNT, MARK)
    own: dict[str, list[float]] = {"printed": [], "corrected": [], "extended": []}
    for angle in np.linspace(0.1, 1.5, 8):
        found = eye.find(drawn(PAD, above(6.0, float(angle))))
        assert found is not None
        x, y, w, h = cv2.boundingRect(found[0].contour)
        filled = np.zeros((h, w), np.uint8)
        cv2.fillPoly(filled, [found[0].contour - [x, y]], 1)
        seen = affine_invariants(central_moments(filled))
        for kind, values in own.items():
            values.append(value(seen, eye._template.invariants, kind))  # type: ignore[arg-type]
    assert max(own["extended"]) < 0.3 and max(own["corrected"]) < 0.1
    assert min(own["printed"]) > 3.0


def test_corrected_third_order_invariants_leave_the_plus_nearer_than_all_six_do() -> None:
    eye = LeiFrontEnd(CAMERA, MOUNT, MARK)
    plus, own = others()["plus"].invariants, eye._template.invariants
    assert value(plus, own, "corrected") < 0.3
    assert value(plus, own, "extended") > 1.0


def test_the_printed_threshold_loses_a_small_mark_and_holds_it_in_a_region() -> None:
    """With 5 levels of noise, half of the ground lies above the mean, and so do its upper class and threshold."""
    image = drawn([(H, 190)], above(12.0), noise=5.0)
    prediction = PadPrediction(np.array([0.0, 0.0, 12.0]), 0.3, np.full(3, 0.1), 0.1)

    def found(threshold: str, region: str) -> bool:
        reading = LeiReading(thresholds=(threshold,), region=region)  # type: ignore[arg-type]
        return LeiFrontEnd(CAMERA, MOUNT, MARK, reading).find(image, prediction) is not None

    assert not found("printed", "whole")
    assert found("open", "predicted") and found("otsu", "predicted")
    assert LeiFrontEnd(CAMERA, MOUNT, MARK).find(image, prediction) is not None


def test_a_cut_h_is_not_measured() -> None:
    assert LeiFrontEnd(CAMERA, MOUNT, MARK).find(drawn(PAD, above(4.0, 0.0, 1.4))) is None


def test_nothing_is_seen_in_noise_and_a_picture_of_another_size_is_refused() -> None:
    eye = LeiFrontEnd(CAMERA, MOUNT, MARK)
    noise = np.random.default_rng(0).integers(0, 255, (494, 768)).astype(np.uint8)
    assert eye.see(noise, LEVEL) is None
    assert eye.see(np.full((494, 768), 90, np.uint8), LEVEL) is None
    with pytest.raises(ValueError, match="768x494"):
        eye.see(noise[:-1], LEVEL)


# the whole


@pytest.mark.parametrize("depth", [3.0, 5.12, 9.32, 13.52, 17.72])
def test_a_sighting_has_place_and_angle_and_says_how_good_its_height_is(depth: float) -> None:
    eye = LeiFrontEnd(CAMERA, MOUNT, MARK, LeiReading(height=HeightReading("side", "calibrated", "exact")))
    attitude = quaternion(0.04, -0.03, 1.0)
    level = level_axes(attitude, MOUNT)
    rng, errors = np.random.default_rng(round(depth)), []
    for seed in range(4):
        pose = above(depth, float(rng.uniform(0, np.pi)), *(0.03 * depth * rng.uniform(-1, 1, 2)))
        grey = drawn(PAD, pose, attitude, seed=seed)
        seen = eye.see(grey, attitude)
        assert seen is not None and seen.source == "acquired"
        assert np.abs(seen.position[:2] - pose.position[:2]).max() < 1.2 * depth / 800
        assert abs(wrap_axis(seen.angle - pose.angle)) < math.radians(1.5)
        assert seen.residual < 1.2
        errors.append((-(seen.position - pose.position) @ level.up) / seen.std_position[2])
        coloured = eye.see(np.repeat(grey[..., None], 3, axis=2), attitude)
        assert coloured is not None
        np.testing.assert_allclose(coloured.position, seen.position, rtol=0.01)
    assert np.abs(errors).max() < 3.0


def test_the_stated_deviation_is_the_papers_on_the_four_landings() -> None:
    stated = [LENGTH_STD * h**2 / math.sqrt(CAMERA.fx * CAMERA.fy) for h in (5.12, 9.32, 13.52, 17.72)]
    assert math.sqrt(np.mean(np.square(stated))) == pytest.approx(0.351, rel=0.01)


def test_it_is_the_published_eye_of_an_h() -> None:
    camera = CameraSpec(25.0, 0.04, CAMERA, MOUNT)
    equipment = Equipment({}, {"down": camera}, MARK, 0.2, 150.0, 101325.0, 288.0, np.array([0.0, 20.0, -40.0]))
    assert isinstance(pad_eye(equipment, "published"), LeiFrontEnd)
    assert not isinstance(pad_eye(equipment, "helideck"), LeiFrontEnd)
    assert pad_eye(replace(equipment, mark=None), "published") is None
