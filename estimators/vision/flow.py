"""How far the ground has moved in the down camera's pictures since a key frame.

Zeng and Jiang match blocks between consecutive pictures and add up what they find; so every frame's error stays in the
sum. Here pictures are matched with one and the same key frame as long as enough of it is in sight: the error of the
motion does not grow with time. Blocks are found to parts of a pixel, and a plane's homography is fitted to all of them
robustly: what moves otherwise, such as a shadow, loses the vote.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision import sad
from flightlog.camera import CameraModel
from flightlog.signals import FlowSample, Frame

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class KeyFrameFlow:
    """Settings of the matching."""

    size: int = 16  # [px] of a block's side
    spacing: int = 44  # [px] of the blocks' grid
    reach: int = 3  # [px] of the fine search, after the coarse one
    shrink: int = 4  # [1] the coarse search has pictures so much smaller
    coarse_reach: int = 8  # [px] of the small picture: 32 px, 0.8 m/s from 1 m
    coarse_spacing: int = 24  # [px] of the small picture
    texture: float = 3.0  # [grey levels] a block has to show
    agreement: float = 0.7  # [px] a block may miss the plane's motion by
    least_share: float = 0.4  # of the key frame's blocks: with fewer in sight, the picture becomes the next one
    least_blocks: int = 12
    patience: int = 5  # pictures that may fail before the key frame is given up

    @classmethod
    def of(cls, camera: CameraModel) -> "KeyFrameFlow":
        """For pictures of a size: small ones have their blocks closer together and are shrunk less."""
        side = min(camera.width, camera.height)
        spacing = int(min(cls.spacing, max(8.0, math.sqrt(camera.width * camera.height / 80))))
        return cls(spacing=spacing, shrink=4 if side >= 360 else 2 if side >= 180 else 1)


@dataclass(frozen=True, eq=False)
class _Key:
    """A picture that others are compared with."""

    t: float  # [s]
    image: Image
    small: Image
    corners: Integers  # (N, 2) of the blocks with texture
    small_corners: Integers  # (M, 2)


@dataclass(frozen=True, eq=False)
class Motion:
    """How the key frame's plane lies in a picture."""

    plane: Floats  # (3, 3) key frame's undistorted tangents to the picture's
    share: float  # [0..1] of the key frame's blocks that agree
    residual: float  # [px] RMS of those
    blocks: Floats  # (N, 2, 2) [px] their middles in the key frame and in the picture


class KeyFrameFlowEye:
    """Flow since a key frame; remembers that picture and the last motion."""

    def __init__(self, camera: CameraModel, settings: KeyFrameFlow | None = None) -> None:
        self.camera, self.settings = camera, settings or KeyFrameFlow.of(camera)
        self._key: _Key | None = None
        self._plane = np.eye(3)
        self._failures = 0
        self.motion: Motion | None = None  # of the last picture

    @property
    def lines(self) -> Sequence[Floats]:
        """Lines (2, 2) [px] to draw over the last picture: the way of each block since the key frame."""
        return () if self.motion is None else tuple(self.motion.blocks)

    def see(self, frame: Frame) -> FlowSample | None:
        """Image motion from the key frame to this picture (H, W); None for the first.

        `dt` reaches back to the key frame. Quality: the share of its blocks that agree; 0, and u, v NaN, where
        nothing was found.
        """
        if self._key is None:
            self._keep(frame)
            return None
        key, old = self._key, self._plane
        self.motion = motion = self._compare(key, frame.image)
        if motion is None:
            self._failures += 1
            self._plane = old
            if self._failures >= self.settings.patience:
                self._keep(frame)
            return FlowSample(frame.t, frame.t_arrival, frame.t - key.t, math.nan, math.nan, 0.0)
        self._failures = 0
        self._plane = motion.plane
        u, v = (motion.plane[:2, 2] / motion.plane[2, 2]).tolist()
        if motion.share < self.settings.least_share:
            self._keep(frame)
        return FlowSample(frame.t, frame.t_arrival, frame.t - key.t, u, v, motion.share)

    def _keep(self, frame: Frame) -> None:
        """Make this picture the key frame."""
        s = self.settings
        small = _shrunk(frame.image, s.shrink)
        corners, small_corners = _grid(frame.image, s.size, s.spacing, s.reach), _grid(small, s.size, s.coarse_spacing)
        self._key = _Key(
            frame.t, frame.image, small,
            corners[sad.texture(frame.image, corners, s.size) >= s.texture],
            small_corners[sad.texture(small, small_corners, s.size) >= s.texture],
        )  # fmt: skip
        self._plane = np.eye(3)
        self._failures = 0

    def _compare(self, key: _Key, image: Image) -> Motion | None:
        """The motion since a key frame, starting from the last picture's."""
        if len(key.corners) < self.settings.least_blocks:
            return None
        s, camera = self.settings, self.camera
        k = camera.matrix
        warp = k @ self._plane @ np.linalg.inv(k)  # key frame's pixels to the picture's; the lens is left to the search
        coarse = self._coarse(key, image, warp)
        if coarse is None:
            return None
        warp = warp @ np.array([[1.0, 0.0, coarse[0]], [0.0, 1.0, coarse[1]], [0.0, 0.0, 1.0]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        seen = np.asarray(cv2.warpPerspective(image, warp, image.shape[::-1], flags=flags), np.uint8)
        corners = key.corners[self._in_sight(key.corners, warp, image)]
        if len(corners) < s.least_blocks:
            return None
        found = sad.match(key.image, seen, corners, s.size, s.reach)
        moved = found[:, :2] + sad.refine(found)
        inside = np.all(np.abs(found[:, :2]) < s.reach, axis=1) & np.all(np.isfinite(moved), axis=1)
        if np.count_nonzero(inside) < s.least_blocks:
            return None
        centres = corners[inside] + 0.5 * (s.size - 1)
        there = cv2.perspectiveTransform((centres + moved[inside])[None].astype(float), warp)[0]
        first, second = (camera.rays(points)[:, :2] * [camera.fx, camera.fy] for points in (centres, there))
        plane, agree = cv2.findHomography(first, second, cv2.RANSAC, s.agreement)
        if plane is None or np.count_nonzero(agree) < s.least_blocks:
            return None
        agrees = agree.ravel().astype(bool)
        missed = cv2.perspectiveTransform(first[None, agrees], plane)[0] - second[agrees]
        scale = np.diag([camera.fx, camera.fy, 1.0])
        return Motion(
            plane=np.linalg.inv(scale) @ plane @ scale,
            share=float(np.count_nonzero(agrees)) / len(key.corners),
            residual=float(np.sqrt(np.mean(missed**2))),
            blocks=np.stack([centres, there], axis=1)[agrees],
        )

    def _coarse(self, key: _Key, image: Image, warp: Floats) -> Floats | None:
        """How far [px] the picture lies from where it was expected, by small pictures; None where no blocks agree."""
        s = self.settings
        n, half = s.shrink, 0.5 * (s.shrink - 1)
        grow = np.array([[n, 0.0, half], [0.0, n, half], [0.0, 0.0, 1.0]])
        small = _shrunk(image, n)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        warp = np.linalg.inv(grow) @ warp @ grow
        seen = np.asarray(cv2.warpPerspective(small, warp, small.shape[::-1], flags=flags), np.uint8)
        corners = key.small_corners
        if len(corners) < 3:
            return np.zeros(2)
        # a block that has left the picture in part is still better than none
        corners = corners[self._in_sight(corners, warp, small)]
        if len(corners) < 3:
            return np.zeros(2)
        moved = sad.match(key.small, seen, corners, s.size, s.coarse_reach)[:, :2]
        middle = np.median(moved, axis=0)
        near = np.all(np.abs(moved - middle) <= 1.5, axis=1)
        if np.count_nonzero(near) < 0.3 * len(moved):
            return None
        return n * moved[near].mean(axis=0)

    def _in_sight(self, corners: Integers, warp: Floats, image: Image) -> NDArray[np.bool_]:
        """Which blocks lie in the picture whole."""
        s = self.settings
        ends = np.stack([corners, corners + s.size - 1, corners + [s.size - 1, 0], corners + [0, s.size - 1]], axis=1)
        there = cv2.perspectiveTransform(ends.reshape(1, -1, 2).astype(float), warp).reshape(-1, 4, 2)
        high = np.array(image.shape[::-1]) - 1.0
        return np.asarray(np.all((there >= 0.0) & (there <= high), axis=(1, 2)))


def _shrunk(image: Image, times: int) -> Image:
    height, width = (side // times * times for side in image.shape)
    size = (width // times, height // times)
    return np.asarray(cv2.resize(image[:height, :width], size, interpolation=cv2.INTER_AREA), np.uint8)


def _grid(image: Image, size: int, spacing: int, margin: int = 0) -> Integers:
    """Upper left corners (N, 2) of blocks on a grid, `margin` [px] away from the picture's edge."""
    height, width = image.shape
    x = np.arange(margin, width - size - margin + 1, spacing)
    y = np.arange(margin, height - size - margin + 1, spacing)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2).astype(np.int64)
