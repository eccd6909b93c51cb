"""The H's front end on synthetic pictures with known truth, and on rendered ones."""

import math
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import pytest

from estimators.vision.h_mark import HMarkFrontEnd, reduced
from estimators.vision.pose import LevelAxes, MarkPose, from_pad_plane, level_axes, on_pad_plane, place, wrap_axis
from estimators.vision.sighting import PadPrediction, PadSighting
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import HMark
from flightlog.rotations import from_vector, matrix, multiply, quaternion

CAMERA = CameraModel.centred(768, 494, 952.4, 816.3)
MOUNT = CameraMount.downward(np.zeros(3))
MARK = HMark()


def ideal(camera: CameraModel = CAMERA, **other: Any) -> HMarkFrontEnd:
    """A front end that is told that attitude, lens and mark are exactly known."""
    return HMarkFrontEnd(camera, MOUNT, MARK, **({"tilt_std": 0.0, "scale_std": 0.0, "pixel_std": 0.0} | other))


@dataclass(frozen=True)
class Shot:
    image: np.ndarray
    attitude: np.ndarray
    level: LevelAxes
    pose: MarkPose

    def prediction(self, rng: np.random.Generator, std: float = 0.02, std_angle: float = 0.01) -> PadPrediction:
        return PadPrediction(
            self.pose.position + rng.normal(0, std, 3), self.pose.angle + rng.normal(0, std_angle),
            np.full(3, std), std_angle,
        )  # fmt: skip

    def error(self, seen: PadSighting) -> np.ndarray:
        """Error (4,) of x, y, z [m] and angle [rad]."""
        return np.append(seen.position - self.pose.position, wrap_axis(seen.angle - self.pose.angle))


def shoot(
    painter: Any, height: float, rng: np.random.Generator, *, look: Any = None, tilt: float = 0.08, stray: float = 0.25,
    camera: CameraModel = CAMERA,
) -> Shot:  # fmt: skip
    """The mark somewhere within `stray` of the picture's half size about its centre."""
    attitude = quaternion(*rng.uniform(-tilt, tilt, 2), rng.uniform(0, 2 * math.pi))
    level = level_axes(attitude, MOUNT)
    half = np.array([camera.width, camera.height]) / 2
    pixel = np.array([camera.cx, camera.cy]) + rng.uniform(-stray, stray, 2) * half
    right, forward = on_pad_plane(pixel, camera, level)[0]
    pose = MarkPose(from_pad_plane(right, forward, height, level), wrap_axis(rng.uniform(-2, 2)))
    image = painter.picture(camera, pose, level, MARK, rng, look or painter.Look())
    return Shot(image, attitude, level, pose)


def seen_by(front_end: HMarkFrontEnd, shot: Shot, prediction: PadPrediction | None) -> PadSighting:
    seen = front_end.see(shot.image, shot.attitude, prediction)
    assert seen is not None
    return seen


@pytest.mark.parametrize(
    ("height", "std_z", "bias_z", "runs"),
    [(10.0, 2.0e-3, 1.0e-3, 24), (5.12, 0.6e-3, 0.2e-3, 8), (2.0, 0.2e-3, 0.1e-3, 5)],
)
def test_accuracy_at_known_attitude(painter: Any, height: float, std_z: float, bias_z: float, runs: int) -> None:
    """Noise 5 grey levels, blur 0.7 px; means are allowed three of their own standard deviations on top."""
    rng = np.random.default_rng(11)
    front_end = ideal()
    shots = [shoot(painter, height, rng) for _ in range(runs)]
    errors = np.array([shot.error(seen_by(front_end, shot, shot.prediction(rng))) for shot in shots])
    spread = errors.std(axis=0, ddof=1)
    assert spread[2] <= std_z
    assert abs(errors[:, 2].mean()) <= bias_z + 3 * spread[2] / math.sqrt(runs)
    assert np.abs(errors[:, :2]).max() < 1e-4 * height
    assert np.degrees(np.abs(errors[:, 3]).max()) < 0.06


def test_covariance_is_consistent(painter: Any) -> None:
    """Normalised squared error over random poses, 4 degrees of freedom; chi-square bounds at 99.9 %."""
    rng = np.random.default_rng(12)
    front_end = ideal()
    squares = []
    for _ in range(50):
        shot = shoot(painter, rng.uniform(5.0, 16.0), rng)
        seen = seen_by(front_end, shot, shot.prediction(rng))
        error = shot.error(seen)
        squares.append(error @ np.linalg.solve(seen.covariance, error))
        np.testing.assert_allclose(seen.std_position, np.sqrt(np.diag(seen.covariance)[:3]))
    assert 2.75 < np.mean(squares) < 5.5


@pytest.mark.parametrize("height", [17.7, 10.0, 5.0, 2.6])
def test_found_without_any_knowledge(painter: Any, height: float) -> None:
    rng = np.random.default_rng(13)
    front_end = ideal()
    for _ in range(4):
        shot = shoot(painter, height, rng, stray=0.08)
        seen = seen_by(front_end, shot, None)
        assert seen.source == "acquired"
        assert seen.visible == 1.0
        assert np.linalg.norm(shot.error(seen)[:3]) < 1.5e-3 * height
        assert abs(shot.error(seen)[3]) < math.radians(0.15)
        assert -math.pi / 2 < seen.angle <= math.pi / 2
        corners = CAMERA.project(place(MARK.outline(), shot.pose, shot.level))
        # the H may be turned by 180 deg, which takes each corner to the one six places on
        turned = np.roll(corners, -6, axis=0)
        assert min(np.abs(seen.outline - corners).max(), np.abs(seen.outline - turned).max()) < 0.5


def test_a_dark_mark_on_light_ground_is_found(painter: Any) -> None:
    rng = np.random.default_rng(14)
    shot = shoot(painter, 8.0, rng, look=painter.Look(mark=60.0, ground=180.0))
    seen = seen_by(ideal(), shot, None)
    assert np.linalg.norm(shot.error(seen)[:3]) < 5e-3
    assert seen.contrast < -80.0


@pytest.mark.parametrize("height", [1.5, 1.0, 0.7, 0.5])
def test_the_cut_mark_is_followed(painter: Any, height: float) -> None:
    """Directions that the visible edges determine are right; the others are declared unknown and do not run away."""
    rng = np.random.default_rng(15)
    front_end = HMarkFrontEnd(CAMERA, MOUNT, MARK)
    determined = []
    for _ in range(6):
        shot = shoot(painter, height, rng, tilt=0.05, look=painter.Look(blur=1.2))
        prediction = shot.prediction(rng, std=0.01)
        seen = seen_by(front_end, shot, prediction)
        error = shot.error(seen)
        assert seen.source == "cut"
        assert 0.0 < seen.visible < 1.0
        assert np.all(np.abs(error[:3]) < 0.06)
        values, vectors = np.linalg.eigh(seen.covariance[:3, :3])
        along = np.abs(vectors.T @ error[:3])
        assert np.all(along <= 4.0 * np.sqrt(values))
        assert np.all(along[values < 0.02**2] < 0.005)
        determined.append(int((values < 0.02**2).sum()))
    assert np.mean(determined) >= (2.9 if height >= 1.0 else 1.0)


def test_only_the_bar_in_view_leaves_the_direction_along_it_open(painter: Any) -> None:
    """0.5 m above the centre, legs out of the picture: x unknown, y, z and angle known."""
    rng = np.random.default_rng(16)
    attitude = quaternion(0.0, 0.0, 1.0)
    level = level_axes(attitude, MOUNT)
    pose = MarkPose(np.array([0.03, -0.01, 0.5]), 0.0)
    image = painter.picture(CAMERA, pose, level, MARK, rng)
    shot = Shot(image, attitude, level, pose)
    off = PadPrediction(pose.position + [0.02, 0.008, 0.01], 0.01, np.array([0.02, 0.01, 0.01]), 0.01)
    seen = seen_by(HMarkFrontEnd(CAMERA, MOUNT, MARK), shot, off)
    assert seen.std_position[0] > 1.0
    assert seen.std_position[1] < 2e-3 and seen.std_position[2] < 2e-3
    error = shot.error(seen)
    assert abs(error[0]) < 0.025  # stays where it was predicted
    assert abs(error[1]) < 1e-3 and abs(error[2]) < 2e-3 and abs(error[3]) < 2e-3


def test_a_wrong_attitude_within_its_tolerance_is_carried_by_the_covariance(painter: Any) -> None:
    rng = np.random.default_rng(17)
    front_end = HMarkFrontEnd(CAMERA, MOUNT, MARK, tilt_std=math.radians(0.5), scale_std=0.0, pixel_std=0.0)
    squares = []
    for _ in range(10):
        shot = shoot(painter, rng.uniform(2.2, 6.0), rng)
        turn = math.radians(0.5) * rng.standard_normal(2)
        attitude = multiply(shot.attitude, from_vector(np.append(turn, 0.0)))
        seen = front_end.see(shot.image, attitude, shot.prediction(rng))
        assert seen is not None
        error = shot.error(seen)[:3]
        squares.append(error @ np.linalg.solve(seen.covariance[:3, :3], error))
    assert np.mean(squares) < 6.0


def test_tilt_is_solved_where_the_mark_is_large(painter: Any) -> None:
    """Without any attitude: level is assumed within 10 deg, and corrected by the perspective of the mark."""
    rng = np.random.default_rng(18)
    front_end = ideal(tilt_std=math.radians(10.0))
    for _ in range(4):
        shot = shoot(painter, 2.6, rng, stray=0.05, tilt=0.1)
        seen = front_end.see(shot.image, quaternion(0.0, 0.0, 0.0))
        assert seen is not None
        assert np.degrees(math.acos(seen.up @ shot.level.up)) < 0.6
        assert np.linalg.norm(seen.position - shot.pose.position) < 0.01


def test_a_bent_lens_is_taken_into_account(painter: Any) -> None:
    camera = CameraModel(640, 480, 520.0, 500.0, 322.0, 236.0, (-0.25, 0.07, 5e-4, -3e-4, 0.0))
    rng = np.random.default_rng(19)
    front_end = ideal(camera)
    for prediction in (True, False):
        shot = shoot(painter, 3.0, rng, stray=0.4, camera=camera)
        seen = seen_by(front_end, shot, shot.prediction(rng) if prediction else None)
        assert np.linalg.norm(shot.error(seen)[:3]) < 2e-3


def _occluded(image: np.ndarray, centre: np.ndarray, size: float, rng: np.random.Generator) -> np.ndarray:
    direction = rng.uniform(0, 2 * math.pi)
    at = centre + 0.45 * size * np.array([math.cos(direction), math.sin(direction)])
    return np.asarray(cv2.circle(image.copy(), tuple(int(v) for v in at), int(0.35 * size), 60, -1))


def _shadowed(image: np.ndarray, centre: np.ndarray, size: float, rng: np.random.Generator) -> np.ndarray:
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    at = centre + 0.3 * size * rng.standard_normal(2)
    shade = 1.0 - 0.5 / (1.0 + np.exp((np.hypot(x - at[0], y - at[1]) - 0.6 * size) / (0.08 * size)))
    return np.asarray(image * shade, np.uint8)


def _glaring(image: np.ndarray, centre: np.ndarray, size: float, rng: np.random.Generator) -> np.ndarray:
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    at = centre + 0.3 * size * rng.standard_normal(2)
    spot = 200.0 * np.exp(-((x - at[0]) ** 2 + (y - at[1]) ** 2) / (2 * (0.25 * size) ** 2))
    return np.asarray(np.clip(image + spot, 0, 255), np.uint8)


@pytest.mark.parametrize("deface", [_occluded, _shadowed, _glaring])
@pytest.mark.parametrize("height", [10.0, 3.5])
def test_a_defaced_mark_is_followed_and_never_wrong(painter: Any, height: float, deface: Any) -> None:
    rng = np.random.default_rng(20)
    front_end = HMarkFrontEnd(CAMERA, MOUNT, MARK)
    for _ in range(5):
        shot = shoot(painter, height, rng)
        centre = CAMERA.project(shot.pose.position)[0]
        defaced = replace(shot, image=deface(shot.image, centre, CAMERA.fx / shot.pose.position[2], rng))
        tracked = seen_by(front_end, defaced, defaced.prediction(rng))
        assert np.linalg.norm(shot.error(tracked)[:3]) < 3e-3 * height
        found = front_end.see(defaced.image, defaced.attitude)
        assert found is None or np.linalg.norm(shot.error(found)[:3]) < 3e-3 * height


def _smeared(shot: Shot, sweep: np.ndarray, rng: np.random.Generator) -> Shot:
    """Mean over a straight motion (2,) [px], with noise of its own."""
    moved = [
        cv2.warpAffine(shot.image.astype(np.float32), np.array([[1.0, 0.0, f * sweep[0]], [0.0, 1.0, f * sweep[1]]]),
                       shot.image.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
        for f in (np.arange(24) + 0.5) / 24 - 0.5
    ]  # fmt: skip
    grey = np.mean(moved, axis=0) + rng.normal(0.0, 5.0, shot.image.shape)
    return replace(shot, image=np.clip(np.rint(grey), 0, 255).astype(np.uint8))


@pytest.mark.parametrize(("strokes", "least"), [(0.2, 10), (0.5, 9), (1.0, 0)])
def test_motion_by_part_of_a_stroke_is_seen_through_and_more_is_not_taken_for_a_pose(
    painter: Any, strokes: float, least: int
) -> None:
    rng = np.random.default_rng(30)
    front_end, found = HMarkFrontEnd(CAMERA, MOUNT, MARK), 0
    for _ in range(10):
        shot = shoot(painter, rng.uniform(4.0, 12.0), rng)
        angle, length = rng.uniform(0.0, math.pi), strokes * MARK.stroke * CAMERA.fy / shot.pose.position[2]
        shot = _smeared(shot, length * np.array([math.cos(angle), math.sin(angle)]), rng)
        seen = front_end.see(shot.image, shot.attitude, shot.prediction(rng))
        if seen is not None:
            found += 1
            assert np.all(np.abs(shot.error(seen)) < 5.0 * np.append(seen.std_position, seen.std_angle))
    assert found >= least


def test_clutter_is_not_taken_for_the_mark(painter: Any) -> None:
    rng = np.random.default_rng(21)
    front_end = HMarkFrontEnd(CAMERA, MOUNT, MARK)
    for _ in range(3):
        shot = shoot(painter, 6.0, rng, look=painter.Look(texture=25.0))
        found = front_end.see(shot.image, shot.attitude)
        assert found is None or np.linalg.norm(shot.error(found)[:3]) < 0.02
        tracked = seen_by(front_end, shot, shot.prediction(rng))
        assert np.linalg.norm(shot.error(tracked)[:3]) < 0.02
        grass = painter.Look(mark=80.0, texture=25.0)  # the mark has the ground's own grey
        bare = shoot(painter, 6.0, rng, look=grass)
        grain = cv2.GaussianBlur(rng.standard_normal(bare.image.shape), (0, 0), 2.0)
        empty = np.clip(110 + 30 * grain / grain.std(), 0, 255).astype(np.uint8)
        assert front_end.see(empty, bare.attitude) is None
        assert front_end.see(empty, bare.attitude, bare.prediction(rng)) is None
        low = PadPrediction(np.array([0.0, 0.0, 0.8]), 0.3, np.full(3, 0.02), 0.02)
        assert front_end.see(empty, bare.attitude, low) is None


def _letter(name: str) -> np.ndarray:
    image = np.full((494, 768), 80, np.uint8)
    strokes = {
        "T": [(300, 150, 400, 170), (340, 150, 360, 250)],
        "I": [(340, 150, 360, 250)],
        "plus": [(340, 150, 360, 250), (300, 190, 400, 210)],
        "window": [(300, 150, 400, 170), (300, 230, 400, 250), (300, 150, 320, 250), (380, 150, 400, 250)],
        "U": [(300, 150, 320, 250), (380, 150, 400, 250), (300, 230, 400, 250)],
        "N": [(300, 150, 320, 250), (380, 150, 400, 250), (300, 150, 400, 170)],
        "square": [(300, 150, 400, 250)],
    }[name]
    for x0, y0, x1, y1 in strokes:
        image[y0:y1, x0:x1] = 200
    return image


@pytest.mark.parametrize("name", ["T", "I", "plus", "window", "U", "N", "square"])
def test_other_signs_are_refused(name: str) -> None:
    front_end = HMarkFrontEnd(CAMERA, MOUNT, MARK)
    noise = np.random.default_rng(22).normal(0, 4, (494, 768))
    image = np.clip(cv2.GaussianBlur(_letter(name), (0, 0), 0.7) + noise, 0, 255).astype(np.uint8)
    level = quaternion(0.0, 0.0, 0.0)
    assert front_end.see(image, level) is None
    near = PadPrediction(np.array([-0.35, -0.57, 9.52]), 0.0, np.full(3, 0.05), 0.02)
    assert front_end.see(image, level, near) is None


def test_darkness_and_emptiness_give_nothing() -> None:
    front_end = HMarkFrontEnd(CAMERA, MOUNT, MARK)
    level = quaternion(0.02, 0.01, 0.5)
    near = PadPrediction(np.array([0.0, 0.0, 5.0]), 0.0, np.full(3, 0.05), 0.02)
    rng = np.random.default_rng(23)
    for image in (
        np.zeros((494, 768), np.uint8),
        np.full((494, 768), 255, np.uint8),
        np.clip(rng.normal(6, 3, (494, 768)), 0, 255).astype(np.uint8),
    ):
        assert front_end.see(image, level) is None
        assert front_end.see(image, level, near) is None


def test_a_mistaken_prediction_is_overruled_by_the_whole_picture(painter: Any) -> None:
    rng = np.random.default_rng(24)
    shot = shoot(painter, 10.0, rng)
    mistaken = PadPrediction(shot.pose.position + [1.2, -0.9, 1.0], shot.pose.angle, np.full(3, 0.03), 0.01)
    seen = seen_by(HMarkFrontEnd(CAMERA, MOUNT, MARK), shot, mistaken)
    assert seen.source == "acquired"
    assert np.linalg.norm(shot.error(seen)[:3]) < 0.02


def test_a_vague_prediction_leads_to_the_mark(painter: Any) -> None:
    rng = np.random.default_rng(25)
    front_end = HMarkFrontEnd(CAMERA, MOUNT, MARK)
    shot = shoot(painter, 9.0, rng)
    vague = PadPrediction(shot.pose.position + [0.4, -0.5, 0.8], 1.0, np.full(3, 0.6), 0.5)
    seen = seen_by(front_end, shot, vague)
    assert seen.source == "acquired"
    assert np.linalg.norm(shot.error(seen)[:3]) < 0.02


def test_other_proportions_without_a_longest_direction(painter: Any) -> None:
    mark = HMark(leg=1.45, width=1.0, stroke=0.2)
    rng = np.random.default_rng(26)
    front_end = HMarkFrontEnd(CAMERA, MOUNT, mark, tilt_std=0.0)
    moments = cv2.moments(mark.outline().astype(np.float32))
    assert 0.8 < moments["mu02"] / moments["mu20"] < 1.25  # the second moments do not give the angle
    level = level_axes(quaternion(0.03, -0.04, 0.2), MOUNT)
    for angle in (0.1, 1.3, -0.8):
        pose = MarkPose(np.array([0.3, 0.2, 8.0]), angle)
        image = painter.picture(CAMERA, pose, level, mark, rng)
        seen = front_end.see(image, quaternion(0.03, -0.04, 0.2))
        assert seen is not None
        assert np.linalg.norm(seen.position - pose.position) < 0.01
        assert abs(wrap_axis(seen.angle - angle)) < 2e-3


@pytest.mark.parametrize("factor", [1, 2, 4, 8])
def test_a_reduced_picture_and_its_camera_agree(factor: int) -> None:
    """The centroid of a soft spot lies where the reduced camera projects its point."""
    point = np.array([[0.31, -0.17, 2.0]])
    at = CAMERA.project(point)[0]
    y, x = np.mgrid[:494, :768]
    spot = np.rint(200 * np.exp(-((x - at[0]) ** 2 + (y - at[1]) ** 2) / (2 * 20.0**2))).astype(np.uint8)
    small, camera = reduced(spot, CAMERA, factor)
    assert small.shape == (camera.height, camera.width)
    weights = small.astype(float)
    y, x = np.mgrid[: camera.height, : camera.width]
    centroid = np.array([(x * weights).sum(), (y * weights).sum()]) / weights.sum()
    np.testing.assert_allclose(centroid, camera.project(point)[0], atol=0.05)


def test_a_colour_picture_serves_too(painter: Any) -> None:
    rng = np.random.default_rng(29)
    shot = shoot(painter, 8.0, rng)
    coloured = replace(shot, image=np.repeat(shot.image[:, :, None], 3, axis=2))
    np.testing.assert_allclose(seen_by(ideal(), coloured, None).position, seen_by(ideal(), shot, None).position)


def test_same_picture_same_answer(painter: Any) -> None:
    rng = np.random.default_rng(27)
    shot = shoot(painter, 7.0, rng)
    prediction = shot.prediction(rng)
    first, second = (seen_by(HMarkFrontEnd(CAMERA, MOUNT, MARK), shot, prediction) for _ in range(2))
    np.testing.assert_array_equal(first.position, second.position)
    assert first.angle == second.angle


def test_bad_use_is_answered_clearly() -> None:
    front_end = HMarkFrontEnd(CAMERA, MOUNT, MARK)
    with pytest.raises(ValueError, match="picture: 100x50, the camera has 768x494"):
        front_end.see(np.zeros((50, 100), np.uint8), quaternion(0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="variant"):
        HMarkFrontEnd(CAMERA, MOUNT, MARK, variant="imaginary")  # type: ignore[arg-type]


@pytest.mark.render
@pytest.mark.parametrize(
    ("height", "lateral", "vertical"), [(10.0, 1.5e-3, 1.2e-2), (3.0, 5e-4, 2e-3), (1.2, 3e-4, 1e-3)]
)
def test_rendered_pads(height: float, lateral: float, vertical: float) -> None:
    """The flight renderer with motion blur, noise and the machine's shadow."""
    import assets
    from flightlog.equipment import CameraSpec
    from sim.cameras.imaging import Imaging
    from sim.cameras.renderer import Renderer
    from sim.cameras.request import FrameRequest
    from sim.light import Light
    from sim.scene import compose

    sun = Light(math.radians(80.0))
    spec = {"down": CameraSpec(25.0, 0.04, CAMERA, MOUNT)}
    scene = compose(assets.path("vehicles", "raptor90.xml"), "field", MARK, spec, sun)
    rng = np.random.default_rng(28)
    front_end = HMarkFrontEnd(CAMERA, MOUNT, MARK)
    with Renderer(scene, {"down": Imaging(colour=False)}, seed=4) as renderer:
        for i in range(6):
            q = quaternion(*rng.uniform(-0.06, 0.06, 2), rng.uniform(0, 2 * math.pi))
            at = np.append(rng.uniform(-0.05, 0.05, 2) * height, height)
            qpos = renderer.model.qpos0.copy()
            qpos[:3], qpos[3:7] = at, q
            qvel = np.zeros(renderer.model.nv)
            qvel[:3], qvel[3:6] = rng.normal(0, 0.3, 3), rng.normal(0, 0.1, 3)
            image = renderer.frame(FrameRequest("down", 0.0, i, qpos, qvel, sun))
            axes = matrix(q) @ MOUNT.axes
            level = level_axes(q, MOUNT)
            north = axes.T @ np.array([0.0, 1.0, 0.0])
            angle = wrap_axis(math.atan2(north @ level.right, north @ level.forward))
            shot = Shot(image, q, level, MarkPose(-axes.T @ at, angle))
            for prediction in (shot.prediction(rng, 0.01), None):
                whole = CAMERA.contains(CAMERA.project(place(MARK.outline(), shot.pose, level)), 3.0).all()
                if prediction is None and not whole:
                    continue
                error = shot.error(seen_by(front_end, shot, prediction))
                assert np.abs(error[:2]).max() < lateral
                assert abs(error[2]) < vertical
                assert abs(error[3]) < math.radians(0.1)
