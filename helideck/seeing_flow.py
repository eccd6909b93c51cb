"""Velocity over the ground from two pictures of the user's own: what `see flow` says."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from estimators.flow_inertial import velocity_between
from estimators.vision.flow import KeyFrameFlowEye
from estimators.vision.integer_flow import IntegerFlow, IntegerFlowEye
from estimators.zeng_navigator import velocity_over_ground
from flightlog.camera import CameraModel, CameraMount
from flightlog.errors import UserError
from flightlog.rotations import quaternion
from flightlog.signals import FlowSample, Frame
from helideck.pictures import Image, PictureError

DOWN = CameraMount.downward(np.zeros(3))


@dataclass(frozen=True)
class FlowAnswer:
    """What two pictures say; None where nothing was found in both."""

    first: Path
    second: Path
    found: bool
    vx_m_s: float | None  # velocity of the camera over the ground, forward
    vy_m_s: float | None  # left
    quality: float  # [0..1]
    u_px: float | None  # motion of the picture's middle, right
    v_px: float | None  # down


@dataclass(frozen=True)
class Flight:
    """How the camera was carried between the pictures."""

    height: float  # [m] of the camera above the ground
    dt: float  # [s]
    rates: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [rad/s] body axes x forward, y left, z up
    roll: float = 0.0  # [rad]
    pitch: float = 0.0  # [rad]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.height) and self.height > 0.0):
            raise UserError(f"--height {self.height}: must be a positive number of metres")
        if not (math.isfinite(self.dt) and self.dt > 0.0):
            raise UserError(f"--dt {self.dt}: must be a positive number of seconds")
        if not max(abs(self.roll), abs(self.pitch)) < math.pi / 2:
            raise UserError("--roll-deg and --pitch-deg must lie within 90")


def parse_rates(text: str | None) -> tuple[float, float, float]:
    """wx, wy, wz [rad/s] from "wx,wy,wz"; none without text."""
    try:
        wx, wy, wz = (0.0, 0.0, 0.0) if text is None else map(float, text.split(","))
    except ValueError:
        raise UserError(f"--gyro {text}: must be three numbers wx,wy,wz in rad/s") from None
    if not math.isfinite(wx + wy + wz):
        raise UserError(f"--gyro {text}: must be finite")
    return wx, wy, wz


def look(
    paths: tuple[Path, Path], pictures: tuple[Image, Image], camera: CameraModel, flight: Flight,
    variant: Literal["helideck", "published"],
) -> FlowAnswer:  # fmt: skip
    """Velocity from two pictures (H, W) of one camera that looks down, image up being forward."""
    if pictures[0].shape != pictures[1].shape:
        (h, w), (h_2, w_2) = pictures[0].shape, pictures[1].shape
        raise PictureError(f"{paths[1]}: is {w_2}x{h_2}, {paths[0]} is {w}x{h}; both must be of one size")
    sample = _match(pictures, camera, flight.dt, variant)
    if sample is None or not math.isfinite(sample.u + sample.v):
        return FlowAnswer(*paths, False, None, None, 0.0, None, None)
    rates, attitude = np.array(flight.rates), quaternion(flight.roll, flight.pitch, 0.0)
    if variant == "published":
        right, down = velocity_over_ground(sample.u, sample.v, sample.dt, DOWN.axes.T @ rates, flight.height)
        forward, left = -down, -right
    else:
        try:
            forward, left = velocity_between(sample, DOWN, attitude, rates, flight.height)
        except ValueError as error:
            raise UserError(f"{paths[1]}: {error}: too much roll, pitch or turning") from None
    return FlowAnswer(*paths, True, forward, left, sample.quality, sample.u * camera.fx, sample.v * camera.fy)


def _match(
    pictures: tuple[Image, Image], camera: CameraModel, dt: float, variant: Literal["helideck", "published"]
) -> FlowSample | None:
    if variant == "helideck":
        ours = KeyFrameFlowEye(camera)
        ours.see(Frame(0.0, 0.0, "down", pictures[0]))
        return ours.see(Frame(dt, dt, "down", pictures[1]))
    settings = IntegerFlow()
    side = min(camera.width, camera.height)
    if side < settings.window:
        raise UserError(f"see flow: pictures of {camera.width}x{camera.height}; at least {settings.window} px a side")
    theirs = IntegerFlowEye(camera, IntegerFlow(shrink=min(settings.shrink, side // settings.window)))
    theirs.see(Frame(0.0, 0.0, "down", pictures[0]))
    return theirs.see(Frame(dt, dt, "down", pictures[1]))
