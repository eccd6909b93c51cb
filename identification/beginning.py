"""Where and how a flight begins, as far as that can be known before it is filtered, and by what a first pass shows."""

import math
from collections.abc import Mapping
from functools import reduce

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from flightlog.camera import DOWN
from flightlog.rotations import matrix, quaternion
from flightlog.tables import Table
from identification import kinematics as k
from identification.first_look import displaced
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SETTLED = 1.0  # [s] until the filter knows where it is
ALIGNED = 5.0  # [s] until it knows how it lies


def start(
    tables: Mapping[str, Table], imu: Floats, imu_t: Floats, samples_a_turn: int, camera: Floats | None
) -> Floats:
    """Position, velocity and attitude (10,) to begin with: level by the force, heading by the field."""
    fx, fy, fz = imu[: max(10, samples_a_turn * 5), :3].mean(axis=0)
    roll, pitch = math.atan2(fy, fz), math.atan2(fx, math.hypot(fy, fz))
    heading = 0.0
    if "mag" in tables and len(tables["mag"]):
        mx, my, mz = tables["mag"].stack("mx", "my", "mz")[:20].mean(axis=0)
        forward = mx * math.cos(pitch) - math.sin(pitch) * (my * math.sin(roll) + mz * math.cos(roll))
        left = my * math.cos(roll) - mz * math.sin(roll)
        heading = math.atan2(left, forward)
    found = np.zeros(10)
    if "gps" in tables and len(tables["gps"]):
        found[:6] = np.nan_to_num(tables["gps"].stack("e", "n", "u", "ve", "vn", "vu")[0])
    elif "baro" in tables and len(tables["baro"]):
        found[2] = float(tables["baro"]["altitude"][0])
    found[6:] = quaternion(roll, pitch, heading)
    if "pad" in tables and len(tables["pad"]) and camera is not None:
        # what the camera sees is linear in the position only where that is known to some tenths of a metre
        seen = tables["pad"].stack("x", "y", "z")
        first = seen[np.isfinite(seen).all(axis=1)][:1]
        if len(first) and tables["pad"]["t"][0] < imu_t[0] + SETTLED:
            found[:3] = -matrix(found[6:]) @ (DOWN @ first[0] + camera)
    return found


def levelled(imu_t: Floats, imu: Floats, samples: Floats, begun: Floats) -> Floats:
    """The start with the attitude that the gyro leads back to from where the other sensors have shown it.

    A flight that begins while wind and rotor push it is not level where its force says so.
    """
    known = min(int(np.searchsorted(imu_t, imu_t[0] + ALIGNED)), len(imu_t) - 1)
    rate = 0.5 * (imu[:known, 3:] + imu[1 : known + 1, 3:])
    turns = Rotation.from_rotvec(rate * np.diff(imu_t[: known + 1])[:, None])
    turned = reduce(Rotation.__mul__, turns, Rotation.identity())
    first = (Rotation.from_quat(samples[known, 6:], scalar_first=True) * turned.inv()).as_quat(scalar_first=True)
    return np.concatenate([begun[:6], first])


def mended(
    vehicle: Vehicle, imu_t: Floats, samples: Floats, kinds: Ints, times: Floats, values: Floats, setup: Floats,
    start: Floats, prior: Floats,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Start and prior where the receiver, by which the start was taken, stands far off the mark."""
    if "gps" not in vehicle.sensors:
        return start, prior
    n = vehicle.sensors["gps"].numbers
    flat, up = np.hypot(n["bias_std"], n["wander_std"]), np.hypot(n["bias_std_up"], n["wander_std_up"])
    off = displaced(imu_t, samples, kinds, times, values, setup, np.array([flat, flat, up]))
    seen = times[kinds == k.PAD]
    if off is None or seen[0] < imu_t[0] + SETTLED:  # else the mark itself is where it began
        return start, prior
    start, prior = start.copy(), prior.copy()
    start[:3] -= off[0]
    prior[k.P : k.P + 3] = off[1] ** 2
    return start, prior
