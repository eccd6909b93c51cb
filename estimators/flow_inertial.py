"""From image motion to the way over the ground, and that into the position filter.

Zeng and Jiang, equations 2 and 3, take the gyroscopes' turning out of the flow and multiply by height over focal
length. Both are first orders of one exact relation, used here: a point of the ground that was straight ahead of the
camera at the key frame is seen in the direction (u, v, 1) now; attitude and height say where it lies from the vehicle
at either time, and the difference is the way.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators.altitude import AltitudeFilter, H
from estimators.attitude import AttitudeFilter
from estimators.position import AFTER, PositionFilter
from flightlog.camera import CameraMount
from flightlog.equipment import CameraSpec
from flightlog.rotations import angles, from_vector, matrix
from flightlog.signals import FlowSample

Floats = NDArray[np.float64]

DIRECTION = 1e-4  # [rad] of a flow of quality 1: matching, and the attitude's jitter between two pictures
WORST = 0.1  # [1] quality below which a flow is none
HEIGHT_KNOWN = 0.05  # [1] standard deviation of the height, as a share of it, from which on flow is a way
SAME = 1e-4  # [s] key frames closer than this are one


@dataclass(frozen=True, eq=False)
class Sight:
    """A point of the ground as seen once."""

    offset: Floats  # (2,) [m] east, north of the vehicle
    slope: Floats  # (2,) [1] the same of the camera, for each metre of height
    below: float  # [m] camera above the ground
    height: float  # [m] body origin above the ground
    std_height: float  # [m]


def sight(
    t: float, direction: Floats, attitude: AttitudeFilter, high: AltitudeFilter, camera: CameraSpec
) -> Sight | None:
    """The point of the ground in a `direction` (3,), camera axes, at `t` [s]; None above the horizontal, or where the
    height is not known yet.
    """
    x, p = high.kalman.state_at(t)
    turn = matrix(attitude.at(t))
    arm, ray = turn @ camera.mount.position, turn @ camera.mount.axes @ direction
    below, std = float(x[H] + arm[2]), math.sqrt(float(p[H, H]))
    if below <= 0.05 or std > HEIGHT_KNOWN * below or ray[2] > -0.3 * np.linalg.norm(ray):
        return None
    slope = ray[:2] / -ray[2]
    return Sight(arm[:2] + below * slope, slope, below, float(x[H]), std)


class FlowFusion:
    """Knows the key frame that flow counts from."""

    def __init__(self, camera: CameraSpec) -> None:
        self._camera = camera
        self._key = -math.inf  # [s] of the key frame
        self._first: Sight | None = None  # its ground point when the filter began to count

    def take(self, s: FlowSample, attitude: AttitudeFilter, high: AltitudeFilter, side: PositionFilter) -> bool:
        """One flow into the position filter; False where it was refused."""
        if not (math.isfinite(s.t + s.dt + s.u + s.v) and s.dt > 0.0 and s.quality >= WORST):
            return False
        key = s.t - s.dt
        if key < self._key - SAME:
            return False
        now = sight(s.t, np.array([s.u, s.v, 1.0]), attitude, high, self._camera)
        if now is None:
            return False
        if key > self._key + SAME or self._first is None:
            first = sight(key, np.array([0.0, 0.0, 1.0]), attitude, high, self._camera)
            # after what its own picture said of the key frame before
            if first is None or not side.key_frame(key + AFTER, first.height):
                # too long ago: the ground point counts from now on
                self._key, self._first = key, now
                return side.key_frame(s.t + AFTER, now.height)
            self._key, self._first = key, first
        first = self._first
        way = first.offset - now.offset
        stretch = float(np.sum((now.slope - first.slope) ** 2)) * now.std_height**2
        heading = min(float(attitude.memory["variance_heading"][0]), 1.0) * float(way @ way)
        matched = (DIRECTION / s.quality * now.below) ** 2 * (1.0 + float(now.slope @ now.slope))
        return side.flow(s.t, float(way[0]), float(way[1]), matched + stretch + heading, now.height)


def velocity_between(
    s: FlowSample, camera: CameraMount, attitude: Floats, rates: Floats, height: float
) -> tuple[float, float]:
    """Velocity (forward, left) [m/s] of a camera over the ground, mean of the time of a flow, in level axes.

    attitude (4,) wxyz of the carrier at the flow's end, rates (3,) [rad/s] its mean angular rate, body axes; height [m]
    of the camera above the ground. Forward is where the carrier's nose points at the end. ValueError where a direction
    misses the ground.
    """
    end = matrix(attitude)
    start = end @ matrix(from_vector(-s.dt * rates))
    points = []
    for turn, direction in ((start, np.array([0.0, 0.0, 1.0])), (end, np.array([s.u, s.v, 1.0]))):
        ray = turn @ camera.axes @ direction
        if not ray[2] < -0.1:
            raise ValueError("the camera does not look down at the ground")
        points.append(height * ray[:2] / -ray[2])
    e, n = ((points[0] - points[1]) / s.dt).tolist()
    _, _, heading = angles(attitude)
    sine, cosine = math.sin(heading), math.cos(heading)
    return e * sine + n * cosine, n * sine - e * cosine
