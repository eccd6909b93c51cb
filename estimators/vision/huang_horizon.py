"""Roll and pitch as Huang, Li and Fan take them from the horizon's line: two cameras 10 deg apart, or one (section 1).

Equation 6 is printed upside down, 10 deg (delta2 - delta1) / Delta delta, and grows where the pitch shrinks; it must
be |theta| = 10 deg * Delta delta / |delta2 - delta1|. The text says that the ground's share grows when the nose goes
down, which gives its sign. Delta delta counts from the shares of level flight.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators.vision.horizon import HorizonSighting
from estimators.vision.huang_line import HuangLine, find_line
from flightlog.camera import CameraModel, CameraMount

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

BETWEEN = math.radians(10.0)  # the second camera's axis below the first one's
TOGETHER = 1e-3  # [s] pictures of one instant
# the paper states no accuracy; measured on rendered pictures (docs/papers.md)
STD_ROLL, STD_PITCH = math.radians(0.5), math.radians(0.6)


def level_share(camera: CameraModel, mount: CameraMount) -> float:
    """The ground's share [1] of a camera's picture in level flight, by its mount; no dip."""
    x, y, z = mount.axes.T @ np.array([0.0, 0.0, 1.0])
    # the plane of the horizon: x (u - cx) / fx + y (v - cy) / fy + z = 0
    middle = (camera.width - 1) / 2
    row = camera.cy - camera.fy * (z + x * (middle - camera.cx) / camera.fx) / y
    return float((camera.height - 0.5 - row) / camera.height)


def pair_pitch(share_a: float, share_b: float, level_a: float, level_b: float) -> float:
    """Pitch [rad], nose up positive, by equations 4 to 6 corrected, from the shares now and in level flight."""
    change = 0.5 * ((share_a - level_a) + (share_b - level_b))
    return -BETWEEN * change / (level_b - level_a)


def exact_angles(line: HuangLine, camera: CameraModel, mount: CameraMount) -> tuple[float, float]:
    """Roll and pitch [rad] of the vehicle by one camera: the plane through camera and line.

    For a camera along the nose with square pixels these are arctan of the slope and atan(d / f), d the distance of the
    line from the principal point.
    """
    up = -camera.matrix.T @ np.array([math.cos(line.theta), math.sin(line.theta), -line.rho])
    x, y, z = mount.axes @ (up / np.linalg.norm(up))
    return math.atan2(y, z), math.asin(max(-1.0, min(1.0, float(x))))


@dataclass
class _Look:
    """The last picture of one camera."""

    t: float = -math.inf  # [s]
    line: HuangLine | None = None


class HuangPair:
    """Both cameras: `a` on the nose axis, `b` 10 deg lower. Each has its eye; the later of two pictures answers."""

    def __init__(self, a: tuple[CameraModel, CameraMount], b: tuple[CameraModel, CameraMount]) -> None:
        self.cameras = {"a": a[0], "b": b[0]}
        self.levels = {"a": level_share(*a), "b": level_share(*b)}
        self._looks = {"a": _Look(), "b": _Look()}

    def eye(self, which: str) -> "HuangEye":
        """What looks at the pictures of camera "a" or "b"."""
        return HuangEye(self, which)

    def see(self, which: str, image: Image, t: float) -> HorizonSighting | None:
        """A picture of camera "a" or "b" taken at `t` [s]; None until the other one's of that time is there too."""
        self._looks[which] = _Look(t, find_line(image))
        a, b = self._looks["a"], self._looks["b"]
        if abs(a.t - b.t) > TOGETHER or a.line is None or b.line is None:
            return None
        return self.measure(a.line, b.line, which)

    def measure(self, line_a: HuangLine, line_b: HuangLine, drawn: str = "a") -> HorizonSighting:
        """Roll from camera A's line (equation 1), pitch from both (equations 2 to 6)."""
        lines = {"a": line_a, "b": line_b}
        shares = {k: lines[k].ground_share(camera.width, camera.height) for k, camera in self.cameras.items()}
        pitch = pair_pitch(shares["a"], shares["b"], self.levels["a"], self.levels["b"])
        right = self.cameras[drawn].width - 1.0
        ends = (0.0, lines[drawn].row(0.0)), (right, lines[drawn].row(right))
        return HorizonSighting(line_a.roll, pitch, STD_ROLL, STD_PITCH, ends, math.nan)


class HuangEye:
    """One camera's eye of a pair."""

    def __init__(self, pair: HuangPair, which: str) -> None:
        self._pair, self._which = pair, which

    def see(self, image: Image, t: float = math.nan) -> HorizonSighting | None:
        """Roll and pitch from this picture and the other camera's of the same time `t` [s]."""
        return self._pair.see(self._which, image, t)
