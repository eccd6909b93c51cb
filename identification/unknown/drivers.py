"""What an effect may depend on, along a helicopter's flight, as known before each node was measured.

A value that the node's own measurement has had a part in would carry its noise into what it is held against.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightlog.rotations import angles
from identification.evidence import Sheet
from identification.grid import CONTROLS, ROTOR, SHARE
from identification.views import rotations

Floats = NDArray[np.float64]

NEAR = 0.3  # [m] finest scale of heights at the ground


@dataclass(frozen=True, eq=False)
class Driver:
    """One quantity along one flight."""

    unit: str
    values: Floats  # (N,) at the nodes
    near: float | None = None  # see `basis`


def drivers(sheet: Sheet) -> Mapping[str, Driver]:
    """By name; speeds are through the air that blows on the mean."""
    flight = sheet.flight
    motion = flight.motion
    grid = flight.drive.coarse
    begin = np.minimum(grid.edges[:-1], len(grid.table) - 1)
    table = grid.table[begin]
    before = np.maximum(np.arange(len(motion.t)) - 1, 0)  # the node before this one
    air = motion.velocity[before] - table[:, SHARE : SHARE + 1] * sheet.wind
    body = np.einsum("nji,nj->ni", rotations(flight)[before], air)
    rates = motion.way[:, 12:15] - sheet.surprise()
    tilt = np.array([angles(q) for q in motion.attitude])[before]
    found = {
        "height": Driver("m", motion.position[before, 2], NEAR),
        "speed": Driver("m/s", np.hypot(air[:, 0], air[:, 1])),
        "forward_speed": Driver("m/s", body[:, 0]),
        "left_speed": Driver("m/s", body[:, 1]),
        "climb": Driver("m/s", air[:, 2]),
        "roll": Driver("rad", tilt[:, 0]),
        "pitch": Driver("rad", tilt[:, 1]),
        "heading": Driver("rad", tilt[:, 2]),
        "roll_rate": Driver("rad/s", rates[:, 0]),
        "pitch_rate": Driver("rad/s", rates[:, 1]),
        "yaw_rate": Driver("rad/s", rates[:, 2]),
        "rotor_speed": Driver("rad/s", table[:, ROTOR]),
        "time": Driver("s", motion.t - motion.t[0]),
    }
    sticks = ("collective", "lateral", "longitudinal", "tail")
    found |= {name: Driver("rad", table[:, CONTROLS + i]) for i, name in enumerate(sticks)}
    return found
