"""The experiments of Wu 2019's calibration and refuelling: their parts, small."""

import math

import cv2
import numpy as np
import pytest

from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import RingMark
from flightlog.rotations import matrix, quaternion
from scenarios.experiments import wu2019_calibration, wu2019_readings, wu2019_refuelling
from scenarios.experiments.drawn_pad import DrawnPad
from scenarios.experiments.refuelling_track import track
from sim.cameras.imaging import CLEAN
from sim.textures import ASPHALT


def test_a_drawn_ring_lies_where_the_camera_model_has_it():
    """Centroid of the outermost ring's inside against the projected circle, to a twentieth of a pixel."""
    camera = CameraModel.centred(768, 494, 952.4, 816.3)
    mount = CameraMount.downward(np.array([0.0, 0.0, -0.1]))
    pad = DrawnPad(RingMark(), camera, mount, CLEAN)
    attitude, position = quaternion(0.05, -0.04, 0.7), np.array([0.3, -0.4, 4.0])
    image = pad.picture(position, attitude, np.zeros(3), np.zeros(3), np.random.default_rng(0))
    axes = matrix(attitude) @ mount.axes
    eye = position + matrix(attitude) @ mount.position
    around = np.linspace(0, 2 * math.pi, 400, endpoint=False)
    rim = np.column_stack([np.cos(around), np.sin(around), np.zeros(400)])
    outer = camera.project((0.50 * rim - eye) @ axes).astype(np.float32)
    inner = camera.project((0.38 * rim - eye) @ axes).astype(np.float32)
    grey = (cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) if image.ndim == 3 else image).astype(float)
    # between the rings' middles: white within the edge, black beyond it
    wide = camera.project((0.53 * rim - eye) @ axes).astype(np.int32)
    mask = np.zeros(grey.shape, np.uint8)
    cv2.fillPoly(mask, [wide], 1)
    hole = np.zeros(grey.shape, np.uint8)
    cv2.fillPoly(hole, [camera.project((0.34 * rim - eye) @ axes).astype(np.int32)], 1)
    weight = np.where((mask - hole) > 0, grey - 255.0 * ASPHALT, 0.0)
    moments = [cv2.moments(edge.reshape(-1, 1, 2)) for edge in (outer, inner)]
    area = moments[0]["m00"] - moments[1]["m00"]
    expected = [(moments[0][key] - moments[1][key]) / area for key in ("m10", "m01")]
    rows, columns = np.indices(grey.shape)
    seen = [float(np.sum(weight * item) / np.sum(weight)) for item in (columns, rows)]
    np.testing.assert_allclose(seen, expected, atol=0.05)


@pytest.fixture(scope="module")
def short():
    """Four seconds in moderate air, the last 0.4 s of them blind."""
    return track("moderate", 1, 4.1)


def test_the_filter_bridges_the_glare_and_the_region_keeps_the_accuracy(short):
    found = np.isfinite(short.whole[:, 0])
    blind = (short.t - short.t[0]) % 4.0 > 3.6
    assert not found[blind].any()
    assert found[~blind].mean() > 0.95

    def errors(places):
        return np.linalg.norm(places - short.true, axis=1)

    assert np.sqrt(np.nanmean(errors(short.whole) ** 2)) < 0.01
    assert np.sqrt(np.nanmean(errors(short.region) ** 2)) < 0.01
    held = np.linalg.norm(short.whole[found][-1] - short.true[blind], axis=1).max()
    assert np.max(errors(short.filtered)[blind]) < 0.03
    assert np.max(errors(short.filtered)[blind]) < 0.5 * held
    assert np.sqrt(np.nanmean(errors(short.readings["printed"]) ** 2)) > 1.5 * np.sqrt(
        np.nanmean(errors(short.readings["corrected"]) ** 2)
    )


def test_the_answers_come_together(short):
    answers = [short, short, short, wu2019_refuelling.compare_rates(0, 2), wu2019_refuelling.compare_solvers(0, 20)]
    outcome = wu2019_refuelling.conclude("quick", answers)
    assert len(wu2019_refuelling.jobs("quick")) == len(answers)
    assert all(figure.ours is not None and math.isfinite(figure.ours) for figure in outcome.figures)
    assert all(figure.reached is not False for figure in outcome.figures if figure.unit == "m")


def test_level_by_assumption_is_many_times_worse_than_by_attitude():
    level, exact = (wu2019_readings.hold(5.0, how, "corrected", 14.0) for how in (False, True))
    assert np.abs(exact.errors).max() < 0.05
    assert np.abs(level.errors[:, :2]).max() > 5.0 * np.abs(exact.errors[:, :2]).max()


def test_chessboards_show_the_lens():
    """Through the world's own camera; needs a headless OpenGL, as every rendered test does."""
    calibration, corners, missed, picture = wu2019_calibration.take(5, 8)
    outcome = wu2019_calibration.conclude("quick", [(calibration, corners, missed, picture)])
    by_name = {figure.quantity: figure.ours for figure in outcome.figures}
    assert missed <= 1
    assert by_name["focal length, worst error"] < 0.1
    assert by_name["principal point, worst error"] < 1.5
    assert by_name["corners, RMS residual"] < 0.1
