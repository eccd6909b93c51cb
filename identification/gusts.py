"""Turbulence along a flight, as it belongs to the mean wind: how strong, and how soon forgotten.

Strength and length by MIL-F-8785C, as in `sim.wind.dryden`; the spectra across the wind and upwards are of second
order and fall off by 3/tau where one of first order with the same tau has 2/tau: SHORTER lies between the two.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from identification.flight import Flight
from sim.wind.dryden import intensities, lengths
from sim.wind.mean import mean_speed

Floats = NDArray[np.float64]

SHORTER = 0.8  # of the memory L/V
CALM = 1.5  # [m/s] of wind and of airspeed that a flight has at least


@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivative of the model's answer by the wind, world axes.

    The rotor's inflow follows a gust from below or above within some nodes and then takes a third of its force away.
    """

    lasting: Floats  # (N, 7, 3) [1/s or 1/(m s)] by a gust that stays
    sooner: Floats  # (N, 3) [1/s] what an upward gust does to the force beyond that, while the inflow has not followed
    left: float  # of what has not been followed yet, a node later


@dataclass(frozen=True, eq=False)
class Gusts:
    """What gusts do to the model's answer, their memory and usual strength."""

    slopes: Floats  # (N, 7, 3) [1/s or 1/(m s)], world axes
    sooner: Floats  # (N, 3) [1/s] of the force by an upward gust that the inflow has not followed yet
    follow: Floats  # (4, 2) over a node: gust and what the inflow has followed, at the end and in the mean
    fresh: Floats  # (4, 4) covariance of what is new in them, for steps of variance one
    keep: Floats  # (N, 3) factor of a gust a node
    std: Floats  # (N, 3) [m/s]


def usual(flight: Flight, wind: Floats, slopes: Slopes) -> Gusts:
    """Gusts of a flight in this mean wind (3,) [m/s] at 10 m."""
    motion = flight.motion
    height, speed = motion.position[:, 2], max(float(np.linalg.norm(wind[:2])), CALM)
    air = motion.velocity.copy()
    air[:, :2] -= np.array([mean_speed(h, 1.0) for h in height])[:, None] * wind[:2]
    airspeed = np.maximum(np.linalg.norm(air, axis=1), CALM)
    length = np.array([lengths(h) for h in height])[:, [0, 0, 1]]
    std = np.array([intensities(h, speed) for h in height])[:, [0, 0, 1]]
    keep = np.exp(-motion.step * airspeed[:, None] / (SHORTER * length))
    return Gusts(slopes.lasting, slopes.sooner, *followed(slopes.left), keep, std)


def followed(left: float) -> tuple[Floats, Floats]:
    """Of a gust g that walks at random and of l' = (g - l)/tau, over a node: see `Gusts`; left: exp(-node/tau).

    Ends and means of both as x' = A x + (1, 0, 0, 0) noise; transition and covariance by Van Loan, IEEE Trans. Autom.
    Control 23, 1978, equation 2.3.
    """
    rate = -math.log(left)
    a = np.array([[0.0, 0, 0, 0], [rate, -rate, 0, 0], [1.0, 0, 0, 0], [0, 1.0, 0, 0]])
    drive = np.diag([1.0, 0.0, 0.0, 0.0])
    both = expm(np.block([[-a, drive], [np.zeros((4, 4)), a.T]]))
    transition = both[4:, 4:].T
    return np.ascontiguousarray(transition[:, :2]), np.ascontiguousarray(transition @ both[:4, 4:])
