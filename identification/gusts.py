"""Turbulence along a flight, as it belongs to the mean wind: how strong, and how soon forgotten.

Strength and length by MIL-F-8785C, as in `sim.wind.dryden`; the spectra across the wind and upwards are of second
order and fall off by 3/tau where one of first order with the same tau has 2/tau: SHORTER lies between the two.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.flight import Flight
from sim.wind.dryden import intensities, lengths
from sim.wind.mean import mean_speed

Floats = NDArray[np.float64]

SHORTER = 0.8  # of the memory L/V
CALM = 1.5  # [m/s] of wind and of airspeed that a flight has at least


@dataclass(frozen=True, eq=False)
class Gusts:
    """What gusts do to the model's answer, their memory and usual strength."""

    slopes: Floats  # (N, 7, 3) [1/s or 1/(m s)], world axes
    keep: Floats  # (N, 3) factor of a gust a node
    std: Floats  # (N, 3) [m/s]


def usual(flight: Flight, wind: Floats, slopes: Floats) -> Gusts:
    """Gusts of a flight in this mean wind (3,) [m/s] at 10 m."""
    motion = flight.motion
    height, speed = motion.position[:, 2], max(float(np.linalg.norm(wind[:2])), CALM)
    air = motion.velocity.copy()
    air[:, :2] -= np.array([mean_speed(h, 1.0) for h in height])[:, None] * wind[:2]
    airspeed = np.maximum(np.linalg.norm(air, axis=1), CALM)
    length = np.array([lengths(h) for h in height])[:, [0, 0, 1]]
    std = np.array([intensities(h, speed) for h in height])[:, [0, 0, 1]]
    return Gusts(slopes, np.exp(-motion.step * airspeed[:, None] / (SHORTER * length)), std)
