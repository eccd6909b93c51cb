"""Rendered pictures of a mark from a camera that stands still, as on a desk or a landing of the stairs."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import assets
from estimators.vision.outline import OutlineSamples, view
from estimators.vision.pose import MarkPose, level_axes
from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec
from flightlog.marks import HMark, Mark
from flightlog.rotations import matrix, quaternion
from sim.cameras.imaging import Imaging
from sim.cameras.renderer import Renderer
from sim.cameras.request import FrameRequest
from sim.light import Light
from sim.scene import compose
from sim.textures import ASPHALT, PAINT

Floats = NDArray[np.float64]

CAMERA = CameraModel.centred(768, 494, 952.4, 816.3)  # Lei 2012: 8 mm before a 1/2" EIA chip of 8.4 x 9.8 um pixels
MOUNT = CameraMount.downward(np.zeros(3))
VEHICLE = assets.path("vehicles", "raptor90.xml")  # carries the camera; it is not in its own pictures
ASIDE = Light(math.radians(12.0))  # throws the vehicle's shadow out of the picture
SPOT = 0.6  # [px] defocus, texture filter and pixel together, as a Gaussian's deviation


@dataclass(frozen=True, eq=False)
class Stand:
    """Where the camera stands."""

    position: Floats  # (3,) [m] ENU from the mark's centre
    attitude: Floats  # (4,) wxyz of what carries it

    @property
    def to_mark(self) -> Floats:
        """The mark's centre (3,) [m] in camera axes."""
        return np.asarray(-(matrix(self.attitude) @ MOUNT.axes).T @ self.position)

    @property
    def angle(self) -> float:
        """The mark's axis [rad] as `PadSighting.angle` has it, not wrapped."""
        north = (matrix(self.attitude) @ MOUNT.axes).T @ np.array([0.0, 1.0, 0.0])
        level = level_axes(self.attitude, MOUNT)
        return math.atan2(north @ level.right, north @ level.forward)


def stand(rng: np.random.Generator, height: float, *, tilt: float, stray: float, turn: float) -> Stand:
    """One that somebody has set up at a `height` [m].

    Tilted by up to `tilt` [rad] about either axis, headed up to `turn` [rad] from the mark's axis, the mark up to
    `stray` of the height off the optical axis.
    """
    roll, pitch = rng.uniform(-tilt, tilt, 2)
    attitude = quaternion(roll, pitch, rng.uniform(-turn, turn))
    axis = matrix(attitude) @ MOUNT.axes[:, 2]
    off = rng.uniform(-stray, stray, 2) * height
    return Stand(np.append(axis[:2] / axis[2] * height + off, height), attitude)


@dataclass(eq=False)
class StillCamera:
    """Takes the pictures; made by `still_camera`."""

    renderer: Renderer

    def picture(self, where: Stand, index: int) -> NDArray[np.uint8]:
        """What the camera delivers (H, W); `index` decides its noise."""
        qpos = self.renderer.model.qpos0.copy()
        qpos[:3], qpos[3:7] = where.position, where.attitude
        return self.renderer.frame(FrameRequest("down", 0.0, index, qpos, np.zeros(self.renderer.model.nv), ASIDE))


@contextmanager
def still_camera(mark: Mark, scene: str, imaging: Imaging, seed: int) -> Iterator[StillCamera]:
    """A camera over a mark in a scene of assets/scenes."""
    spec = CameraSpec(25.0, 0.0, CAMERA, MOUNT, colour=False)
    with Renderer(compose(VEHICLE, scene, mark, {"down": spec}, ASIDE), {"down": imaging}, seed) as renderer:
        yield StillCamera(renderer)


def edge_noise(imaging: Imaging) -> float:
    """Standard deviation [px] of the best estimate of an edge's place from one row of pixels across it.

    (sigma/A) sqrt(2 sqrt(pi) s) for noise sigma, step A and a Gaussian spot s: Cramer-Rao with pixels as samples.
    """
    full = 255.0 * Light.HORIZONTAL * imaging.exposure.gain * ASIDE.illuminance
    levels = np.array([PAINT, ASPHALT]) * full
    variance = imaging.noise.read**2 + imaging.noise.shot**2 * levels.mean() / 255.0
    return float(math.sqrt(variance * 2.0 * math.sqrt(math.pi) * SPOT) / (levels[0] - levels[1]))


def height_bound(mark: HMark, where: Stand, edge_std: float) -> float:
    """Cramer-Rao bound [m] of the mark's distance along the optical axis, attitude known.

    One independent edge point a pixel of outline, its place known to `edge_std` [px]; place and angle to be found too.
    """
    samples = OutlineSamples.of(mark.outline())
    shown = view(samples, CAMERA, MarkPose(where.to_mark, where.angle), level_axes(where.attitude, MOUNT))
    # metres of outline that a sample stands for, from its edge's ends
    ends = np.roll(mark.outline(), -1, axis=0) - mark.outline()
    pixels = shown.pitch * (np.linalg.norm(ends, axis=1) / np.bincount(samples.edge))[samples.edge]
    slopes = shown.jacobian[:, :4]
    return float(edge_std * math.sqrt(np.linalg.inv((slopes * pixels[:, None]).T @ slopes)[2, 2]))
