"""Roll and pitch from the horizon of a forward camera: candidate lines by Hough, then a robust sub-pixel refit.

The visible horizon is a plane through the camera; its normal is the world's up in camera axes, whatever the lens and
the mount (Huang's arctan(slope) and the exact single-camera pitch are its values for an ideal camera). Pitch is to
the visible horizon: its dip below elevation 0 is not added.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.edges import GUARD, KERNEL, edge_offsets
from estimators.vision.pose import project_with_slopes
from estimators.vision.robust import NOISE_FLOOR, solve
from flightlog.camera import CameraModel, CameraMount

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

SEARCH_SCALE = 2  # pictures are searched at half their resolution
STEEPEST = math.radians(65.0)  # slope of the line in the picture
MOST_LINES = 12
SIDE = 5.0  # [px] of the search picture: how far beside a line its two sides are compared
REACH = 8.0  # [px] search along the normals: Hough's bins, and hills
COARSE = 6  # every so many pixels of the search picture tell sky from ground over all of it
POINTS = 200  # along the line
LEAST_SUPPORT = 0.5  # share of the line's points at which the two sides differ as they do on the whole
LEAST_CONTRAST = 6.0  # [grey levels]
RAGGED = 4.0  # [px] RMS beyond which it is no line


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
        s = SEARCH_SCALE
        self._size = (camera.width // s, camera.height // s)
        # the search picture: without the lens, pixel centres at integers
        cx, cy = (camera.cx + 0.5) / s - 0.5, (camera.cy + 0.5) / s - 0.5
        self._k = np.array([[camera.fx / s, 0.0, cx], [0.0, camera.fy / s, cy], [0.0, 0.0, 1.0]])
        y, x = np.mgrid[0 : self._size[1] : COARSE, 0 : self._size[0] : COARSE]
        self._grid = np.column_stack([x.ravel(), y.ravel()]).astype(float)
        self._maps: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
        if camera.distorted:
            x, y = cv2.initUndistortRectifyMap(
                self._k, np.array(camera.distortion), np.eye(3), self._k, self._size, cv2.CV_32FC1
            )
            self._maps = np.asarray(x, np.float32), np.asarray(y, np.float32)

    def see(self, image: Image) -> HorizonSighting | None:
        """The horizon in a picture (H, W, 3) RGB or (H, W), or None."""
        if image.shape[:2] != (self.camera.height, self.camera.width):
            raise ValueError(
                f"picture: {image.shape[1]}x{image.shape[0]}, the camera has {self.camera.width}x{self.camera.height}"
            )
        small = np.asarray(cv2.resize(image, self._size, interpolation=cv2.INTER_AREA), np.uint8)
        if self._maps is not None:
            x, y = self._maps
            small = np.asarray(cv2.remap(small, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)
        best, score = None, 0.0
        for rho, theta in self._lines(small):
            value, channel, sign = self._score(small, rho, theta)
            if value > score:
                best, score = (rho, theta, channel, sign), value
        if best is None:
            return None
        rho, theta, channel, sign = best
        up = self._k.T @ np.array([math.cos(theta), math.sin(theta), -rho])
        up *= -np.sign(up[1]) / np.linalg.norm(up)
        layer = np.ascontiguousarray(image[:, :, channel] if image.ndim == 3 else image)
        return self._refined(layer, up, sign)

    def _lines(self, small: Image) -> list[tuple[float, float]]:
        """Candidates (rho [px], theta [rad]) in the search picture, x cos(theta) + y sin(theta) = rho."""
        grey = small if small.ndim == 2 else cv2.cvtColor(small, cv2.COLOR_RGB2GRAY)
        smooth = cv2.GaussianBlur(grey, (0, 0), 2.0)
        dx, dy = cv2.Sobel(smooth, cv2.CV_16S, 1, 0), cv2.Sobel(smooth, cv2.CV_16S, 0, 1)
        strength = cv2.convertScaleAbs(cv2.addWeighted(cv2.convertScaleAbs(dx), 1.0, cv2.convertScaleAbs(dy), 1.0, 0.0))
        level, _ = cv2.threshold(strength, 0, 255, cv2.THRESH_OTSU)
        edges = cv2.Canny(dx, dy, 0.5 * level, max(level, 4.0))
        # Huang's threshold: a quarter of the picture's width
        found = cv2.HoughLines(
            edges, 1.0, math.radians(1.0), self._size[0] // 4,
            min_theta=math.pi / 2 - STEEPEST, max_theta=math.pi / 2 + STEEPEST,
        )  # fmt: skip
        return [] if found is None else [(float(r), float(t)) for r, t in found.reshape(-1, 2)[:MOST_LINES]]

    def _score(self, small: Image, rho: float, theta: float) -> tuple[float, int, float]:
        """How well a line parts sky from ground: score (0: not at all), the layer that shows it best, its sign.

        Along the line the sides must differ alike; over the picture the two parts must differ more than each varies.
        """
        width, height = self._size
        c, s = math.cos(theta), math.sin(theta)
        t = np.linspace(-0.6, 0.6, 120) * math.hypot(width, height)
        foot = np.array([width / 2, height / 2])
        foot = foot + (rho - foot @ [c, s]) * np.array([c, s])
        along = foot + t[:, None] * [-s, c]
        above, below = along - SIDE * np.array([c, s]), along + SIDE * np.array([c, s])
        within = np.all((np.minimum(above, below) >= 0) & (np.maximum(above, below) <= [width - 1, height - 1]), axis=1)
        if within.sum() < 0.2 * np.count_nonzero(np.abs(t) <= width / 2):
            return 0.0, 0, 1.0
        layers = small.reshape(height, width, -1)
        a, b = np.rint(above[within]).astype(int), np.rint(below[within]).astype(int)
        difference = layers[a[:, 1], a[:, 0]].astype(float) - layers[b[:, 1], b[:, 0]]
        mean = difference.mean(axis=0)
        channel = int(np.argmax(np.abs(mean)))
        if abs(mean[channel]) < LEAST_CONTRAST:
            return 0.0, channel, 1.0
        support = float(np.mean(difference @ mean > 0.4 * mean @ mean))
        if support < LEAST_SUPPORT:
            return 0.0, channel, 1.0
        sky = self._grid @ [c, s] < rho
        number = np.array([np.count_nonzero(sky), np.count_nonzero(~sky)])
        if not number.all():
            return 0.0, channel, 1.0
        coarse = layers[::COARSE, ::COARSE].reshape(len(self._grid), -1).astype(float)
        parts = np.stack([sky, ~sky]).astype(float)
        means = parts @ coarse / number[:, None]
        apart = float(np.sum((means[0] - means[1]) ** 2))
        within_variance = float((np.sum(coarse**2) - np.sum(number[:, None] * means**2)) / len(coarse))
        return support * apart / (within_variance + 1.0), channel, float(np.sign(mean[channel]))

    def _refined(self, layer: Image, up: Floats, sign: float) -> HorizonSighting | None:
        """Sub-pixel fit of the world's up (3,) in camera axes. `sign`: +1 where the sky is the brighter."""
        for _ in range(3):
            ahead = np.array([0.0, 0.0, 1.0]) - up[2] * up
            ahead /= np.linalg.norm(ahead)
            aside = np.cross(up, ahead)
            s = np.linspace(-1.0, 1.0, 2 * POINTS)
            rays = np.cos(s)[:, None] * ahead + np.sin(s)[:, None] * aside
            seen = rays[:, 2] > 0.2
            s, rays = s[seen], rays[seen]
            pixels, slopes = project_with_slopes(self.camera, rays)
            seen = self.camera.contains(pixels, GUARD)
            if seen.sum() < 20:
                return None
            s, pixels, slopes = s[seen], pixels[seen], slopes[seen]
            tangents = (slopes @ (np.cos(s)[:, None] * aside - np.sin(s)[:, None] * ahead)[:, :, None])[:, :, 0]
            downward = -(slopes @ up)
            normals = np.column_stack([tangents[:, 1], -tangents[:, 0]])
            normals /= np.linalg.norm(normals, axis=1)[:, None]
            normals *= np.where(np.sum(normals * downward, axis=1) < 0.0, -1.0, 1.0)[:, None]
            offsets, heights = edge_offsets(layer, pixels, normals, REACH, sign, KERNEL)
            good = np.isfinite(offsets)
            if good.sum() < 20:
                return None
            good &= heights > 0.3 * np.percentile(heights[good], 75)
            if good.sum() < 0.3 * len(s):
                return None
            # up + a ahead + b aside moves a point of the horizon by -(a cos s + b sin s) up
            push = np.sum(normals * downward, axis=1)
            jacobian = (push[:, None] * np.column_stack([np.cos(s), np.sin(s)]))[good]
            step, residuals, scale = solve(jacobian, offsets[good], np.full(2, 1e-9), np.zeros(2))
            up = up + step[0] * ahead + step[1] * aside
            up /= np.linalg.norm(up)
            if np.abs(jacobian @ step).max() < 0.02:
                break
        inliers = np.abs(residuals) <= max(3.0 * scale, 0.3)
        kept = residuals[inliers]
        residual = float(np.sqrt(np.mean(kept**2)))
        if len(kept) < 0.3 * len(s) or residual > RAGGED:
            return None
        # neighbouring points of hills and waves are not independent: fewer measurements than points
        memory = float(np.clip(np.sum(kept[1:] * kept[:-1]) / np.sum(kept**2), 0.0, 0.98))
        noise = max(NOISE_FLOOR, residual) * math.sqrt((1.0 + memory) / (1.0 - memory))
        covariance = noise**2 * np.linalg.inv(jacobian[inliers].T @ jacobian[inliers])
        # hills stand only above the horizon: a ragged line is also displaced, and tilted, by about its raggedness
        covariance += np.diag([residual / self.camera.fy, residual / (0.5 * self.camera.width)]) ** 2
        return self._sighting(up, np.column_stack([ahead, aside]), covariance, residual)

    def _sighting(self, up: Floats, basis: Floats, covariance: Floats, residual: float) -> HorizonSighting:
        """Body angles of `up` (3,) in camera axes; basis (3, 2) and covariance (2, 2) of its error."""
        x, y, z = self.mount.axes @ up
        # world up in body axes is (sin pitch, cos pitch sin roll, cos pitch cos roll)
        by_up = np.array([[0.0, z, -y], [math.hypot(y, z), 0.0, 0.0]]) / [[y * y + z * z], [y * y + z * z]]
        slopes = by_up @ self.mount.axes @ basis
        spread = np.sqrt(np.diag(slopes @ covariance @ slopes.T))
        return HorizonSighting(
            math.atan2(y, z), math.asin(max(-1.0, min(1.0, float(x)))), float(spread[0]), float(spread[1]),
            self._ends(up), residual,
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
