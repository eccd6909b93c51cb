"""What sees pictures for a navigator, and what it is told beforehand."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from estimators.altitude import AltitudeFilter, H
from estimators.position import A_E, D_E, PositionFilter
from estimators.vision.horizon import HorizonSighting
from estimators.vision.sighting import PadPrediction, PadSighting
from flightlog.equipment import CameraSpec
from flightlog.rotations import angles, matrix
from flightlog.signals import FlowSample, Frame

Floats = NDArray[np.float64]

VAGUE = 5.0  # [m] a prediction less sure than this is none


class FrontEnd(Protocol):
    """What sees the pad in a picture."""

    def see(self, image: NDArray[np.uint8], attitude: Floats, prediction: PadPrediction | None) -> PadSighting | None:
        """The mark in a picture (H, W) taken with an attitude (4,) wxyz; None where it is not found."""
        ...


class HorizonEye(Protocol):
    """What sees the horizon in a picture of a forward camera."""

    def see(self, image: NDArray[np.uint8], t: float = math.nan) -> HorizonSighting | None:
        """Roll and pitch of the vehicle from a picture (H, W, 3) RGB of the time `t` [s]; None without a horizon.

        Where two cameras make one eye, the later of their two pictures of one time answers.
        """
        ...


class FlowEye(Protocol):
    """What sees the ground move between pictures; remembers the pictures that it compares with."""

    @property
    def lines(self) -> Sequence[Floats]:
        """Lines (N, 2) [px] to draw over the last picture."""
        ...

    def see(self, frame: Frame) -> FlowSample | None:
        """Image motion up to this picture (H, W); None for the first, or where there is nothing to compare."""
        ...


@dataclass(frozen=True, eq=False)
class Eyes:
    """What looks at which camera's pictures; nothing looks where there is None."""

    pad: FrontEnd | None = None  # down camera
    flow: FlowEye | None = None  # down camera
    horizons: Mapping[str, HorizonEye] = field(default_factory=dict)  # forward cameras by name


def expect_pad(
    t: float, attitude: Floats, std_heading: float, high: AltitudeFilter, side: PositionFilter, camera: CameraSpec
) -> PadPrediction | None:
    """Where the mark should be in a picture of the time `t` [s], taken with an `attitude` (4,) wxyz."""
    x, p = side.kalman.state_at(t)
    z, z_p = high.kalman.state_at(t)
    height = float(z[H])
    # seen through a tilt error the mark is off by the tilt error times the height
    tilt = slice(D_E, A_E)
    variance = np.append(np.diag(p)[:2] + height**2 * np.diag(p)[tilt], z_p[H, H])
    if np.max(variance) > VAGUE**2:
        return None
    to_camera = (matrix(attitude) @ camera.mount.axes).T
    there = to_camera @ -np.append(x[:2] + height * x[tilt], height) - camera.mount.axes.T @ camera.mount.position
    _, _, heading = angles(attitude)
    return PadPrediction(
        position=there,
        angle=math.pi - (math.pi + heading) % (2.0 * math.pi),
        std_position=np.sqrt(to_camera**2 @ variance),
        std_angle=std_heading,
    )
