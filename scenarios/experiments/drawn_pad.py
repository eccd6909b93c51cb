"""Pictures of a pad without OpenGL: its paint seen through the camera, sampled finely and averaged over each pixel.

The lens, exposure, blur and noise behind it are the world's own (`sim.cameras.imaging`).
"""

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import Mark
from flightlog.rotations import matrix
from sim.cameras.blur import image_motion
from sim.cameras.imaging import Imaging, develop
from sim.cameras.optics import Lens, pinhole_behind
from sim.textures import paint_mark

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

FINE = 3  # samples a pixel, either way
DECK = 75  # [grey level] around the pad's square


@dataclass(frozen=True, eq=False)
class DrawnPad:
    """A pad level at the world's origin, and the camera that looks at it."""

    mark: Mark
    camera: CameraModel
    mount: CameraMount
    imaging: Imaging = field(default_factory=lambda: Imaging(colour=False))

    def picture(
        self, position: Floats, attitude: Floats, velocity: Floats, rates: Floats, rng: np.random.Generator
    ) -> Picture:
        """The picture (H, W) from a vehicle at `position` (3,) [m] with `attitude` (4,) wxyz.

        velocity (3,) [m/s] in the world, rates (3,) [rad/s] in body axes: for motion blur.
        """
        turn = matrix(attitude)
        axes = turn @ self.mount.axes
        eye = position + turn @ self.mount.position
        behind = pinhole_behind(self.camera)
        clean = _draw(self.mark, behind, axes, eye)
        spin = turn @ rates
        speed = image_motion(self.camera, axes, eye, velocity + np.cross(spin, eye - position), spin)
        return develop(clean, self.imaging, Lens.of(self.camera), self.imaging.exposure.gain, speed, rng)


def _draw(mark: Mark, camera: CameraModel, axes: Floats, eye: Floats) -> Picture:
    """What a pinhole camera at `eye` (3,) [m] with `axes` (3, 3) sees of the plane z = 0."""
    paint = cv2.cvtColor(paint_mark(mark), cv2.COLOR_RGB2GRAY)
    # about one texel to a sample: more would be left out, fewer are interpolated
    texels = mark.square * max(camera.fx, camera.fy) * FINE / max(float(eye[2]), 0.1)
    texels = int(np.clip(texels, 64, len(paint)))
    paint = cv2.resize(paint, (texels, texels), interpolation=cv2.INTER_AREA)
    side = mark.square
    to_ground = np.array([
        [side / texels, 0.0, (0.5 / texels - 0.5) * side], [0.0, -side / texels, (0.5 - 0.5 / texels) * side],
        [0.0, 0.0, 1.0],
    ])  # fmt: skip
    to_camera = np.column_stack([axes.T[:, 0], axes.T[:, 1], -axes.T @ eye])
    finer = np.array([[FINE, 0.0, 0.5 * FINE - 0.5], [0.0, FINE, 0.5 * FINE - 0.5], [0.0, 0.0, 1.0]])
    size = (camera.width * FINE, camera.height * FINE)
    large = cv2.warpPerspective(
        paint, finer @ camera.matrix @ to_camera @ to_ground, size, flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT, borderValue=DECK,
    )  # fmt: skip
    return np.asarray(cv2.resize(large, (camera.width, camera.height), interpolation=cv2.INTER_AREA), np.uint8)
