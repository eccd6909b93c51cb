"""Rotations in the project's conventions.

World ENU, body x forward, y left, z up, quaternions wxyz from body to world. roll: right side down positive;
pitch: nose up positive; heading: clockwise from north, [0, 2 pi); applied heading, pitch, roll (intrinsic z-y'-x''):

    R = Rz(pi/2 - heading) Ry(-pitch) Rx(roll)

The compiled functions take one rotation and serve the loop; `to_angles`, `from_angles` take whole logs.
"""

import math

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]


@numba.njit(cache=True)
def matrix(q):
    """Rotation matrix (3, 3), body to world, of the unit quaternion `q` (4,) wxyz."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    r = np.empty((3, 3))
    r[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    r[0, 1] = 2.0 * (x * y - w * z)
    r[0, 2] = 2.0 * (x * z + w * y)
    r[1, 0] = 2.0 * (x * y + w * z)
    r[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    r[1, 2] = 2.0 * (y * z - w * x)
    r[2, 0] = 2.0 * (x * z - w * y)
    r[2, 1] = 2.0 * (y * z + w * x)
    r[2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return r


@numba.njit(cache=True)
def multiply(a, b):
    """Quaternion product a b (4,): rotate by `b`, then by `a`."""
    q = np.empty(4)
    q[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    q[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    q[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    q[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    return q


@numba.njit(cache=True)
def from_vector(v):
    """Quaternion (4,) of the rotation vector `v` (3,) [rad]."""
    angle = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    # sin(a/2)/a, by its series where the quotient loses digits
    scale = 0.5 - angle * angle / 48.0 if angle < 1e-4 else math.sin(0.5 * angle) / angle
    q = np.empty(4)
    q[0] = math.cos(0.5 * angle)
    q[1] = scale * v[0]
    q[2] = scale * v[1]
    q[3] = scale * v[2]
    return q


@numba.njit(cache=True)
def quaternion(roll, pitch, heading):
    """Quaternion (4,) wxyz, body to world, of roll, pitch and heading [rad]."""
    half_yaw, half_pitch, half_roll = 0.5 * (0.5 * math.pi - heading), -0.5 * pitch, 0.5 * roll
    cy, sy = math.cos(half_yaw), math.sin(half_yaw)
    cp, sp = math.cos(half_pitch), math.sin(half_pitch)
    cr, sr = math.cos(half_roll), math.sin(half_roll)
    q = np.empty(4)
    q[0] = cy * cp * cr + sy * sp * sr
    q[1] = cy * cp * sr - sy * sp * cr
    q[2] = cy * sp * cr + sy * cp * sr
    q[3] = sy * cp * cr - cy * sp * sr
    return q


@numba.njit(cache=True)
def turn(angle):
    """`angle` [rad] brought into [0, 2 pi)."""
    within = angle % (2.0 * math.pi)
    # the remainder of a tiny negative angle rounds up to the whole circle
    return within if within < 2.0 * math.pi else 0.0


@numba.njit(cache=True)
def angles(q):
    """(roll, pitch, heading) [rad] of the quaternion `q` (4,) wxyz, body to world."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = -math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, turn(0.5 * math.pi - yaw)


@numba.njit(cache=True)
def wrap(angle):
    """`angle` [rad] brought into [-pi, pi)."""
    return turn(angle + math.pi) - math.pi


def from_angles(roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike) -> Rotation:
    """Rotations body to world of whole logs: roll, pitch, heading (N,) [rad]."""
    yaw = 0.5 * np.pi - np.asarray(heading)
    return Rotation.from_euler("ZYX", np.stack([yaw, -np.asarray(pitch), np.asarray(roll)], axis=-1))


def to_angles(rotation: Rotation) -> tuple[Floats, Floats, Floats]:
    """(roll, pitch, heading), each (N,) [rad], of rotations body to world."""
    yaw, pitch, roll = np.moveaxis(rotation.as_euler("ZYX"), -1, 0)
    heading = (0.5 * np.pi - yaw) % (2.0 * np.pi)
    return roll, -pitch, np.where(heading < 2.0 * np.pi, heading, 0.0)
