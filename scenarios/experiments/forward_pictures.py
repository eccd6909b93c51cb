"""Pictures of the two forward cameras at attitudes asked for: rendered scenes, and drawn land with a rough skyline."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec
from flightlog.rotations import matrix, quaternion
from scenarios.cameras import imaging
from scenarios.load import load
from sim import vehicle as vehicles
from sim.cameras.imaging import develop
from sim.cameras.renderer import Renderer
from sim.cameras.request import FrameRequest
from sim.scene import compose

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

CAMERAS = ("forward_a", "forward_b")
FINE = 2  # samples a pixel of drawn land, either way
WAVES = np.array([3.0, 7.0, 13.0, 23.0, 41.0, 67.0])  # of the skyline, a turn


@dataclass(frozen=True)
class Pose:
    """Attitude of the vehicle [rad]."""

    roll: float
    pitch: float
    heading: float


def forward_cameras() -> Mapping[str, CameraSpec]:
    """Both, as fitted to the vehicle of the horizon scenario."""
    cameras = vehicles.load(load("sea_horizon").vehicle).cameras
    return {name: cameras[name] for name in CAMERAS}


def rendered(
    where: str, poses: Sequence[Pose], seed: int, *, height: float = 50.0, dip: bool = False
) -> Iterator[dict[str, Picture]]:
    """Pictures of both cameras by name, RGB, with the scenario's noise, at each pose `height` [m] above the pad."""
    scenario = load("sea_horizon")
    vehicle = vehicles.load(scenario.vehicle)
    light, cameras = scenario.light.light(), forward_cameras()
    scene = compose(vehicle.model, where, None, cameras, light, dip=dip)
    with Renderer(scene, imaging(cameras, scenario.cameras), seed=seed) as renderer:
        still, more = np.zeros(renderer.model.nv), np.zeros(renderer.model.nq - 7)
        for number, pose in enumerate(poses):
            qpos = np.concatenate([[0.0, 0.0, height], quaternion(pose.roll, pose.pitch, pose.heading), more])
            yield {
                name: renderer.frame(FrameRequest(name, 0.0, number, qpos, still, light)) for name in CAMERAS
            }


def drawn(poses: Sequence[Pose], seed: int, hills: float, *, sunk: bool) -> Iterator[dict[str, Picture]]:
    """Clouded sky over land whose skyline has a standard deviation of `hills` [rad] and nothing to mark its foot.

    sunk: as far below elevation 0 as above it, which no terrain is; else plains lie at elevation 0 between hills.
    """
    scenario, cameras = load("sea_horizon"), forward_cameras()
    look = imaging(cameras, scenario.cameras)
    for number, pose in enumerate(poses):
        rng = np.random.default_rng([seed, number])
        phase, size = rng.uniform(0.0, 2.0 * np.pi, len(WAVES)), rng.standard_normal(len(WAVES))
        size *= hills * np.sqrt(2.0 / np.sum(size**2))
        views = {}
        for name, spec in cameras.items():
            clean = _draw(spec.model, spec.mount, pose, size, phase, sunk, rng)
            gain = look[name].exposure.gain
            views[name] = develop(clean, look[name], None, gain, (0.0, 0.0), rng)
        yield views


def _draw(
    camera: CameraModel, mount: CameraMount, pose: Pose, size: Floats, phase: Floats, sunk: bool,
    rng: np.random.Generator,
) -> Picture:  # fmt: skip
    axes = matrix(quaternion(pose.roll, pose.pitch, pose.heading)) @ mount.axes
    sub = (np.arange(FINE) + 0.5) / FINE - 0.5
    columns = (np.arange(camera.width)[:, None] + sub).ravel()
    rows = (np.arange(camera.height)[:, None] + sub).ravel()
    x, y = np.meshgrid((columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy)
    east, north, up = (axes[k, 0] * x + axes[k, 1] * y + axes[k, 2] for k in range(3))
    elevation, azimuth = np.arctan2(up, np.hypot(east, north)), np.arctan2(north, east)
    # the skyline is a function of azimuth alone
    turn = np.linspace(-np.pi, np.pi, 7200)
    height = np.sin(np.multiply.outer(turn, WAVES) + phase) @ size
    skyline = np.interp(azimuth, turn, height if sunk else np.maximum(height, 0.0))
    share = (elevation > skyline).astype(np.float32)
    share = cv2.resize(share, (camera.width, camera.height), interpolation=cv2.INTER_AREA)[:, :, None]
    cloud = cv2.GaussianBlur(rng.standard_normal((camera.height, camera.width)), (0, 0), 25)
    grass = cv2.GaussianBlur(rng.standard_normal((camera.height, camera.width)), (0, 0), 2)
    above = np.array([150.0, 185.0, 225.0]) + (20.0 * np.clip(cloud / cloud.std(), 0, 2))[:, :, None]
    below = np.array([70.0, 95.0, 60.0]) + (12.0 * grass / grass.std())[:, :, None]
    return np.asarray(np.clip(np.rint(below + share * (above - below)), 0, 255), np.uint8)
