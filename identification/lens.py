"""What the down camera's lens does to a mark, and how far that can be known.

Where the picture cuts the mark, a pixel more or less at its border decides which edges measure, and then a lens may
move the mark by ten times as much or by nothing.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightlog.marks import HMark
from flightlog.rotations import matrix
from identification import kinematics as k
from identification.model import tolerance_of
from sim.sensors.pad_camera import by_lens
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# numbers of the front end that decide what measures, as the file has them within tolerances
OPEN = {"margin": "px", "bleed_std": "px", "tilt_std": "rad", "predicted_std": "m"}

WITHIN = 0.03  # of the distance: where the mark is seen from is itself known by what the lens shows

KNOWN = 0.03  # of a first radial coefficient: what a calibration by a few pictures leaves


@dataclass(frozen=True, eq=False)
class Bend:
    """By a first radial coefficient of one beyond the one taken."""

    moved: Floats  # (N, 4): x, y, z [m] and angle [rad] of the mark as reported
    unsure: Floats  # (N, 4): standard deviation of that


def unsure(vehicle: Vehicle, kinds: Ints, times: Floats, t: Floats, motion: Floats) -> Floats:
    """(M,) what a lens as well known as most adds to a mark's deviation [m], [rad]; zero for what is no mark.

    t (N,), motion (N, 10): position, velocity, quaternion along the flight.
    """
    found = np.zeros(len(times))
    rows = np.flatnonzero((kinds >= k.PAD) & (kinds <= k.PAD_ANGLE))
    if not len(rows) or "down" not in vehicle.cameras or "pad" not in vehicle.sensors:
        return found
    seen, which = np.unique(times[rows], return_inverse=True)
    at = np.clip(np.searchsorted(t, seen - 1e-9), 0, len(t) - 1)
    lens = bend(motion[at, :3], np.array([matrix(q) for q in motion[at, 6:]]), vehicle)
    found[rows] = KNOWN * lens.unsure[which, kinds[rows] - k.PAD]
    return found


def bend(positions: Floats, rotations: Floats, vehicle: Vehicle) -> Bend:
    """Of a mark (an H of 1 m, since no log says which) seen from positions (N, 3) [m], rotations (N, 3, 3)."""
    camera, numbers = vehicle.cameras["down"], vehicle.sensors["pad"].numbers

    def by(changed: dict[str, float], scale: float = 1.0) -> Floats:
        at = scale * positions
        return by_lens(at, rotations, camera.model, camera.mount, HMark(), {**numbers, **changed})

    moved = by({})
    square = np.maximum(*((by({}, 1.0 + sign * WITHIN) - moved) ** 2 for sign in (-1.0, 1.0)))
    for name, unit in OPEN.items():
        step = float(tolerance_of(vehicle.document, f"sensors.pad.{name}", unit))
        if step > 0.0:
            other = [by({name: max(numbers[name] + sign * step, 0.1 * step)}) for sign in (-1.0, 1.0)]
            square += np.maximum(*((one - moved) ** 2 for one in other))
    return Bend(moved, np.sqrt(square))
