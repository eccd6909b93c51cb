"""The gain in closed loop: the same landing with the vehicle as it was and as extended, beside what was measured.

Whatever flies is handed in; nothing here knows how.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.helicopter import HelicopterBench
from sim.vehicle import Vehicle

DOWN = 0.15  # [m] of the skids above the ground at the end of what was looked at: it went on to touch


@dataclass(frozen=True)
class Landing:
    """One landing; None where it did not touch down."""

    of: str  # "measured", "before", "after"
    name: str  # flight or seed
    offset_m: float | None  # of the body origin from the pad's centre
    sink_m_s: float | None  # down positive
    drift_m_s: float | None  # horizontal


Fly = Callable[[Vehicle, int], Landing]
"""Flies a vehicle with a seed."""


def compare(fly: Fly, before: Vehicle, after: Vehicle, seeds: Sequence[int]) -> list[Landing]:
    """Fly both vehicles with each seed."""
    found = []
    for of, vehicle in (("before", before), ("after", after)):
        for seed in seeds:
            landing = fly(vehicle, seed)
            found.append(Landing(of, f"seed {seed}", landing.offset_m, landing.sink_m_s, landing.drift_m_s))
    return found


def measured(bench: HelicopterBench) -> list[Landing]:
    """How the measured flights touched down, by their sensors; only those that did."""
    found = []
    for flight in bench.flights:
        if not len(flight.skids) or flight.skids[-1] > DOWN:
            continue
        (e, n, _), (ve, vn, vu) = flight.motion.position[-1], flight.motion.velocity[-1]
        found.append(Landing("measured", flight.name, float(np.hypot(e, n)), float(-vu), float(np.hypot(ve, vn))))
    return found
