"""When pictures are taken and when they arrive: asked for at the exposure, fetched when their latency is over."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from flightlog.equipment import CameraSpec
from flightlog.signals import Frame
from sim.cameras.request import FrameRequest
from sim.light import Light

Picture = NDArray[np.uint8]


class Eyes(Protocol):
    """What takes the pictures: asked at the instant of exposure, fetched when they arrive."""

    def submit(self, request: FrameRequest) -> None:
        """Ask for a picture; returns at once."""
        ...

    def collect(self) -> tuple[FrameRequest, NDArray[np.uint8]]:
        """The oldest request not collected yet with its picture (H, W) or (H, W, 3); waits for it where it must."""
        ...

    def close(self) -> None:
        """Let go of the renderer."""
        ...


@dataclass(frozen=True, eq=False, slots=True)
class Exposure:
    """A picture on its way."""

    request: FrameRequest
    t: float  # [s] as stamped
    t_arrival: float  # [s]
    fetch: Callable[[FrameRequest], Picture]

    def develop(self) -> Frame:
        """The picture; waits for the renderer where it must."""
        return Frame(self.t, self.t_arrival, self.request.camera, self.fetch(self.request))


class Shutter:
    """Counts each camera's pictures and sorts out the order in which the renderer hands them back."""

    def __init__(self, eyes: Eyes, cameras: Mapping[str, CameraSpec]) -> None:
        self._eyes, self._cameras = eyes, cameras
        self._counts = dict.fromkeys(cameras, 0)
        self._developed: dict[tuple[str, int], Picture] = {}

    def expose(self, camera: str, t: float, data: mujoco.MjData, light: Light) -> Exposure:
        """Have a picture taken of this instant [s]; returns at once."""
        index = self._counts[camera]
        self._counts[camera] = index + 1
        request = FrameRequest(camera, t, index, data.qpos.copy(), data.qvel.copy(), light)
        self._eyes.submit(request)
        spec = self._cameras[camera]
        stamp = t + spec.stamp_delay
        return Exposure(request, stamp, max(t, stamp + spec.latency), self._fetch)

    def _fetch(self, request: FrameRequest) -> Picture:
        """The renderer hands pictures out in the order of exposure, which need not be that of arrival."""
        key = (request.camera, request.index)
        while key not in self._developed:
            done, picture = self._eyes.collect()
            self._developed[done.camera, done.index] = picture
        return self._developed.pop(key)
