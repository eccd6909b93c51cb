"""The flight as it was, and as the model says that it should have gone on from where it was.

The model is set upon the measured motion every HORIZON seconds. What it says of force and moment differs from what was
measured; that difference, integrated, is how far its helicopter gets away from the measured one. The attitude that
turns its force is the measured one: within a window the error of that is of second order.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from flightlog.replay_pair import Track
from flightlog.rotations import matrix
from identification.beginning import SETTLED
from identification.helicopter import HelicopterBench
from identification.refit import Refit
from identification.report.unforeseen import foreseen

Floats = NDArray[np.float64]

HORIZON = 2.0  # [s]
MOST_TURNED = 0.5  # [rad] beyond which a small rotation is none


def measured(bench: HelicopterBench, flight: int) -> Track:
    """By the sensors."""
    motion = bench.flights[flight].motion
    return Track("measured", motion.t, motion.position, motion.attitude, np.zeros(0, np.intp))


def simulated(bench: HelicopterBench, flight: int, fit: Refit, name: str) -> Track:
    """By the model at a refit's best values."""
    item = bench.flights[flight]
    motion, step = item.motion, item.motion.step
    answer = foreseen(bench, flight, fit)
    turning = np.zeros_like(item.measured[:, 3:6])
    turning[1:] = np.diff(item.measured[:, 3:6], axis=0) / step
    # on the ground, and until the filter has settled, nothing was judged, and nothing moves apart
    force, moment = np.nan_to_num(answer[:, :3] - item.measured[:, :3]), np.nan_to_num(answer[:, 3:6] - turning)
    early = motion.t < motion.t[0] + SETTLED
    force[early] = moment[early] = 0.0
    rotation = np.array([matrix(q) for q in motion.attitude])
    pushed = np.einsum("nij,nj->ni", rotation, force)
    length = max(2, round(HORIZON / step))
    moved, turned = _twice(pushed, step, length), _twice(moment, step, length)
    size = np.linalg.norm(turned, axis=1, keepdims=True)
    turned *= np.minimum(1.0, MOST_TURNED / np.maximum(size, 1e-12))
    q = motion.attitude[:, [1, 2, 3, 0]]
    attitude = (Rotation.from_quat(q) * Rotation.from_rotvec(turned)).as_quat()[:, [3, 0, 1, 2]]
    return Track(name, motion.t, motion.position + moved, attitude, np.arange(length, len(motion.t), length))


def errors(bench: HelicopterBench, flight: int, fits: Mapping[str, Refit]) -> dict[str, float]:
    """By name, root mean square distance [m] of the simulated helicopter from the measured one at a window's end."""
    way = bench.flights[flight].motion.position
    found = {}
    for name, fit in fits.items():
        track = simulated(bench, flight, fit, name)
        ends = track.breaks - 1
        found[name] = float(np.sqrt(np.mean(np.sum((track.position[ends] - way[ends]) ** 2, axis=1))))
    return found


def _twice(rate: Floats, step: float, length: int) -> Floats:
    """(N, 3) twice integrated, from nothing at the start of every `length` rows."""
    out = np.empty_like(rate)
    for start in range(0, len(rate), length):
        part = slice(start, start + length)
        speed = np.cumsum(rate[part], axis=0) * step
        out[part] = np.cumsum(speed, axis=0) * step
    return out
