"""Pictures of a pad on a deck without OpenGL: paint seen through the camera, sampled finely, averaged over each pixel.

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
from sim.textures import paint_deck, paint_mark

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

DECK = (14.0, 20.0, 1024)  # [m] east and north, texels of its picture
BEYOND = 60  # [grey level] of what is not deck


@dataclass(frozen=True, eq=False)
class DrawnPad:
    """A pad level at the world's origin, and the camera that looks at it."""

    mark: Mark
    camera: CameraModel
    mount: CameraMount
    imaging: Imaging = field(default_factory=lambda: Imaging(colour=False))
    fine: int = 3  # samples a pixel, either way

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
        clean = _draw(self.mark, behind, axes, eye, self.fine)
        spin = turn @ rates
        speed = image_motion(self.camera, axes, eye, velocity + np.cross(spin, eye - position), spin)
        return develop(clean, self.imaging, Lens.of(self.camera), self.imaging.exposure.gain, speed, rng)


def _draw(mark: Mark, camera: CameraModel, axes: Floats, eye: Floats, fine: int) -> Picture:
    """What a pinhole camera at `eye` (3,) [m] with `axes` (3, 3) sees of the plane z = 0."""
    paint = cv2.cvtColor(paint_mark(mark), cv2.COLOR_RGB2GRAY)
    # about one texel to a sample: more would be left out, fewer are interpolated
    texels = mark.square * max(camera.fx, camera.fy) * fine / max(float(eye[2]), 0.1)
    texels = int(np.clip(texels, 64, len(paint)))
    paint = cv2.resize(paint, (texels, texels), interpolation=cv2.INTER_AREA)
    deck = cv2.cvtColor(paint_deck(DECK[2]), cv2.COLOR_RGB2GRAY)
    finer = np.array([[fine, 0.0, 0.5 * fine - 0.5], [0.0, fine, 0.5 * fine - 0.5], [0.0, 0.0, 1.0]])
    to_picture = finer @ camera.matrix @ np.column_stack([axes.T[:, 0], axes.T[:, 1], -axes.T @ eye])
    size = (camera.width * fine, camera.height * fine)
    large = cv2.warpPerspective(
        deck, to_picture @ _to_ground(DECK[0], DECK[1], DECK[2]), size, flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT, borderValue=BEYOND,
    )  # fmt: skip
    cv2.warpPerspective(
        paint, to_picture @ _to_ground(mark.square, mark.square, texels), size, dst=large, flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_TRANSPARENT,
    )  # fmt: skip
    return np.asarray(cv2.resize(large, (camera.width, camera.height), interpolation=cv2.INTER_AREA), np.uint8)


def _to_ground(east: float, north: float, texels: int) -> Floats:
    """From the texels of a picture of a rectangle about the origin to the ground (3, 3): row 0 is north."""
    return np.array([
        [east / texels, 0.0, (0.5 / texels - 0.5) * east], [0.0, -north / texels, (0.5 - 0.5 / texels) * north],
        [0.0, 0.0, 1.0],
    ])  # fmt: skip
