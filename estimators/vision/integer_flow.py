"""Optical flow as Zeng and Jiang have it: block matching between consecutive pictures, in whole pixels.

The paper says neither how large picture, blocks and search are nor how many blocks there are. Read as in PX4FLOW
(Honegger et al. 2013), the same method in print: the middle 64 x 64 pixels of a coarser picture, blocks of 8 x 8, a
search of 4 pixels either way, blocks without texture left out, and the motion that most blocks have is the picture's.
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


@dataclass(frozen=True)
class IntegerFlow:
    """Settings of the matching."""

    shrink: int = 2  # [1] pixels that become one, either way
    window: int = 64  # [px] side of what is looked at, in the middle
    size: int = 8  # [px] of a block's side
    reach: int = 4  # [px] of the search
    texture: float = 4.0  # [grey levels] a block has to show
    least_share: float = 0.2  # of the blocks that must have texture


class IntegerFlowEye:
    """Flow since the picture before."""

    def __init__(self, camera: CameraModel, settings: IntegerFlow = IntegerFlow()) -> None:
        """ValueError where the pictures are too small."""
        self.camera, self.settings = camera, settings
        least = settings.window * settings.shrink
        if min(camera.width, camera.height) < least:
            raise ValueError(f"pictures of {camera.width}x{camera.height} px are too small: at least {least} a side")
        starts = np.arange(settings.reach, settings.window - settings.reach - settings.size + 1, settings.size)
        self._corners = np.stack(np.meshgrid(starts, starts), axis=-1).reshape(-1, 2).astype(np.int64)
        self._last: tuple[float, NDArray[np.uint8]] | None = None

    @property
    def lines(self) -> Sequence[Floats]:
        """None."""
        return ()

    def see(self, frame: Frame) -> FlowSample | None:
        """Image motion since the picture before; None for the first. Quality: the share of the blocks that agree."""
        s, camera = self.settings, self.camera
        height, width = (side // s.shrink for side in frame.image.shape)
        y, x = ((side - s.window) // 2 * s.shrink for side in (height, width))
        cut = frame.image[y : y + s.window * s.shrink, x : x + s.window * s.shrink]
        image = np.asarray(cv2.resize(cut, (s.window, s.window), interpolation=cv2.INTER_AREA), np.uint8)
        before, self._last = self._last, (frame.t, image)
        if before is None:
            return None
        t, first = before
        corners = self._corners[sad.texture(first, self._corners, s.size) >= s.texture]
        if len(corners) < s.least_share * len(self._corners):
            return FlowSample(frame.t, frame.t_arrival, frame.t - t, math.nan, math.nan, 0.0)
        moved = sad.match(first, image, corners, s.size, s.reach)[:, :2]
        motions, votes = np.unique(moved, axis=0, return_counts=True)
        most = int(np.argmax(votes))
        u, v = (motions[most] * s.shrink / [camera.fx, camera.fy]).tolist()
        return FlowSample(frame.t, frame.t_arrival, frame.t - t, u, v, float(votes[most]) / len(self._corners))
