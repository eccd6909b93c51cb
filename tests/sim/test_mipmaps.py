"""The mark's levels of detail: an edge stays where it is painted, from near to far."""

import math

import cv2
import numpy as np
import pytest

import assets
from estimators.vision.h_mark import HMarkFrontEnd
from estimators.vision.pose import level_axes
from estimators.vision.sighting import PadPrediction
from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec
from flightlog.marks import HMark
from flightlog.rotations import matrix, quaternion
from sim.cameras import mipmaps
from sim.cameras.imaging import CLEAN
from sim.cameras.renderer import Renderer
from sim.light import Light
from sim.scene import compose

CAMERA = CameraModel.centred(768, 494, 952.4, 816.3)


def steepest(row: np.ndarray, texel: float) -> float:
    """Place of the steepest slope of a bilinearly magnified row, seen through a spot of 1.2 texels."""
    x = np.arange(0.0, len(row), 0.01)
    slope = np.gradient(np.interp(x, np.arange(len(row)) + 0.5, row))
    slope = cv2.GaussianBlur(slope.reshape(1, -1), (0, 0), 1.2 / 0.01).ravel()
    return float(x[np.argmax(slope)] * texel)


@pytest.mark.parametrize("phase", [0.1, 0.25, 0.4])
def test_a_level_keeps_the_steepest_slope_of_an_edge_that_no_texel_border_meets(phase: float) -> None:
    texels, edge = 256, 128 + 16 * phase  # in texels of the picture, `phase` in those of level 4
    share = np.clip(np.arange(texels) + 1.0 - edge, 0.0, 1.0)
    picture = np.repeat(np.tile(np.rint(40 + 190 * share), (texels, 1))[..., None], 3, axis=2).astype(np.uint8)
    level = mipmaps.levels(picture)[4]
    assert steepest(level[8, :, 0].astype(float), 16.0) == pytest.approx(edge, abs=0.011 * 16)
    averaged = cv2.resize(picture, (16, 16), interpolation=cv2.INTER_AREA)
    if phase == 0.25:  # what the card's own levels do
        assert abs(steepest(averaged[8, :, 0].astype(float), 16.0) - edge) > 0.02 * 16


@pytest.mark.render
def test_a_rendered_h_at_ten_metres_is_measured_without_bias() -> None:
    """Levels averaged 2 x 2 measured it 6 mm too high."""
    mount, light = CameraMount.downward(np.zeros(3)), Light(math.radians(12.0))
    spec = {"down": CameraSpec(25.0, 0.04, CAMERA, mount)}
    scene = compose(assets.path("vehicles", "raptor90.xml"), "field", HMark(), spec, light)
    eye, rng, errors = HMarkFrontEnd(CAMERA, mount, HMark()), np.random.default_rng(3), []
    with Renderer(scene, {"down": CLEAN}) as renderer:
        for _ in range(12):
            q = quaternion(*rng.uniform(-0.06, 0.06, 2), rng.uniform(0, 2 * math.pi))
            at = np.append(rng.uniform(-0.4, 0.4, 2), 10.0)
            qpos = renderer.model.qpos0.copy()
            qpos[:3], qpos[3:7] = at, q
            grey = cv2.cvtColor(renderer.clean("down", qpos, light), cv2.COLOR_RGB2GRAY)
            grey = cv2.GaussianBlur(grey, (3, 3), 0.4)
            axes, level = matrix(q) @ mount.axes, level_axes(q, mount)
            north = axes.T @ np.array([0.0, 1.0, 0.0])
            angle = math.atan2(north @ level.right, north @ level.forward)
            prediction = PadPrediction(-axes.T @ at, angle, np.full(3, 0.01), 0.01)
            sighting = eye.see(grey, q, prediction)
            assert sighting is not None
            errors.append(sighting.position[2] + (axes.T @ at)[2])
    assert abs(np.mean(errors)) < 1e-3
