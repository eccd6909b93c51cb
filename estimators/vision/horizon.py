"""Roll and pitch from the horizon of a forward camera: where the sky ends, refitted to a fraction of a pixel.

The visible horizon is a plane through the camera; its normal is the world's up in camera axes, whatever the lens and
the mount (Huang's arctan(slope) and the exact single-camera pitch are its values for an ideal camera). Pitch is to
the visible horizon: its dip below elevation 0 is not added.
"""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.horizon_fit import HorizonFit, refit, rough
from estimators.vision.horizon_search import HorizonSearch, Line
from flightlog.camera import CameraModel, CameraMount

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

LARGEST = 1280  # [px] longer side; larger pictures are reduced
SEARCH_SIZE = 320  # [px] longer side of the picture that is searched, at most
REACH = 4.0  # [px] of the search picture: along the normals
LEAST_SUPPORT = 0.4  # share of the columns that end their sky at the line: at a straight edge
# at a rough one, more where the sky has grain, less where it stands out from the ground
ROUGH_SUPPORT, FOR_GRAIN, FOR_CONTRAST = 0.8, 0.1, 0.1
MOST_GRAIN, MOST_CONTRAST = 2.0, 4.0
LEAST_STEP = 4.0  # [grey levels] of colour across it


@dataclass(frozen=True)
class HorizonSighting:
    """Roll and pitch of the vehicle, as its forward camera sees the horizon."""

    roll: float  # [rad] right side down positive
    pitch: float  # [rad] nose up positive
    std_roll: float  # [rad]
    std_pitch: float  # [rad]
    line: tuple[tuple[float, float], tuple[float, float]]  # [px] left and right end in the picture, for drawing
    residual: float  # [px] RMS of the edge points used


class HorizonFrontEnd:
    """Looks for the horizon in the pictures of one forward camera. Keeps nothing from one picture to the next."""

    def __init__(self, camera: CameraModel, mount: CameraMount) -> None:
        self.camera, self.mount = camera, mount
        self._reduction = math.ceil(max(camera.width, camera.height) / LARGEST)
        self._work = _reduced(camera, self._reduction)
        self._search_scale = math.ceil(max(self._work.width, self._work.height) / SEARCH_SIZE)
        small = replace(_reduced(self._work, self._search_scale), distortion=(0.0,) * 5)
        self._small = small
        self._search = HorizonSearch(small.width, small.height)
        self._maps: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
        if camera.distorted:
            x, y = cv2.initUndistortRectifyMap(
                small.matrix, np.array(camera.distortion), np.eye(3), small.matrix, (small.width, small.height),
                cv2.CV_32FC1,
            )  # fmt: skip
            self._maps = np.asarray(x, np.float32), np.asarray(y, np.float32)

    def see(self, image: Image, t: float = math.nan) -> HorizonSighting | None:
        """The horizon in a picture (H, W, 3) RGB or (H, W), or None; its time `t` [s] does not matter here."""
        if image.shape[:2] != (self.camera.height, self.camera.width):
            raise ValueError(
                f"picture: {image.shape[1]}x{image.shape[0]}, the camera has {self.camera.width}x{self.camera.height}"
            )
        work = _shrunk(image, self._work)
        small = _shrunk(work, self._small)
        if self._maps is not None:
            x, y = self._maps
            small = np.asarray(cv2.remap(small, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)
        line = self._search.find(small.reshape(*small.shape[:2], -1))
        if line is None or line.support < LEAST_SUPPORT or np.abs(line.step).max() < LEAST_STEP:
            return None
        up, scale = self._up(line), self._search_scale
        fit = refit(_across(work, line.step), self._work, up, REACH * scale)
        if fit is not None:
            return self._sighting(fit, 1.0)
        # roads, edges of fields and clouds are lines too, but what lies above them is no smoother and little brighter
        wanted = ROUGH_SUPPORT + FOR_GRAIN * min(line.grain, MOST_GRAIN)
        if line.support < wanted - FOR_CONTRAST * float(np.clip(line.apart, 0.0, MOST_CONTRAST)):
            return None
        fit = rough(self._points(line), self._small, up)
        return None if fit is None else self._sighting(fit, scale)

    def _up(self, line: Line) -> Floats:
        """World up (3,) in camera axes, were a line of the search picture the horizon."""
        small = self._small
        c, s = math.cos(line.angle), math.sin(line.angle)
        rho = line.offset + s * (small.width - 1) / 2 + c * (small.height - 1) / 2
        up = -small.matrix.T @ np.array([s, c, -rho])
        return np.asarray(up / np.linalg.norm(up))

    def _points(self, line: Line) -> Floats:
        """Pixels (N, 2) of the search picture where its columns end the sky."""
        c, s = math.cos(line.angle), math.sin(line.angle)
        foot = np.array([s, c]) * line.offset + np.array([self._small.width - 1, self._small.height - 1]) / 2
        return np.asarray(foot + line.along[:, None] * [c, -s] + line.beside[:, None] * [s, c])

    def _sighting(self, fit: HorizonFit, scale: float) -> HorizonSighting:
        """Body angles from the world's up in camera axes; `scale`: of the picture in which it was fitted."""
        x, y, z = self.mount.axes @ fit.up
        # world up in body axes is (sin pitch, cos pitch sin roll, cos pitch cos roll)
        by_up = np.array([[0.0, z, -y], [math.hypot(y, z), 0.0, 0.0]]) / [[y * y + z * z], [y * y + z * z]]
        slopes = by_up @ self.mount.axes @ fit.basis
        spread = np.sqrt(np.diag(slopes @ fit.covariance @ slopes.T))
        return HorizonSighting(
            math.atan2(y, z), math.asin(max(-1.0, min(1.0, float(x)))), float(spread[0]), float(spread[1]),
            self._ends(fit.up), fit.residual * scale * self._reduction,
        )  # fmt: skip

    def _ends(self, up: Floats) -> tuple[tuple[float, float], tuple[float, float]]:
        """Where the horizon enters and leaves the picture [px], left end first."""
        ahead = np.array([0.0, 0.0, 1.0]) - up[2] * up
        ahead /= np.linalg.norm(ahead)
        aside = np.cross(up, ahead)
        s = np.linspace(-1.2, 1.2, 1201)
        rays = np.cos(s)[:, None] * ahead + np.sin(s)[:, None] * aside
        pixels = self.camera.project(rays[rays[:, 2] > 0.1])
        pixels = pixels[self.camera.contains(pixels, -0.5)]
        first, last = sorted((tuple(pixels[0].tolist()), tuple(pixels[-1].tolist())))
        return first, last


def _reduced(camera: CameraModel, times: int) -> CameraModel:
    """The camera of a picture reduced by averaging `times` x `times` pixels."""
    if times == 1:
        return camera
    width, height = camera.width // times, camera.height // times
    fx, fy = width / camera.width, height / camera.height
    return CameraModel(
        width, height, camera.fx * fx, camera.fy * fy, (camera.cx + 0.5) * fx - 0.5, (camera.cy + 0.5) * fy - 0.5,
        camera.distortion,
    )  # fmt: skip


def _shrunk(image: Image, camera: CameraModel) -> Image:
    """The picture at the size of a reduced camera."""
    if image.shape[:2] == (camera.height, camera.width):
        return image
    return np.asarray(cv2.resize(image, (camera.width, camera.height), interpolation=cv2.INTER_AREA), np.uint8)


def _across(image: Image, step: Floats) -> Image:
    """The picture as one layer (H, W) in which what changes along `step` (C,) is seen best, and upward is brighter."""
    weights = np.atleast_2d(step) / np.abs(step).sum()
    shift = 255.0 * np.clip(-weights, 0.0, None).sum()
    return np.asarray(cv2.transform(image, np.hstack([weights, [[shift]]])), np.uint8)
