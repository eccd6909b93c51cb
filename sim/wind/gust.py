"""A discrete gust of the 1-cosine shape (MIL-F-8785C, section 3.7.1.3): up to its full speed and back."""

import math
from dataclasses import dataclass

import numba


@dataclass(frozen=True)
class Gust:
    """One gust on top of the wind."""

    start: float  # [s]
    duration: float  # [s] from calm to calm
    speed: float  # [m/s] horizontal, at its height
    wind_from: float = 0.0  # [rad] where it comes from, clockwise from north
    up: float = 0.0  # [m/s] vertical, at its height

    @classmethod
    def of_length(
        cls, start: float, length: float, airspeed: float, speed: float, wind_from: float = 0.0, up: float = 0.0
    ) -> "Gust":
        """The gust that rises over `length` [m] (d_m of the specification) of air flown through at `airspeed` [m/s]."""
        return cls(start, 2.0 * length / airspeed, speed, wind_from, up)


@numba.njit(cache=True)
def shape(since, duration):  # type: ignore[no-untyped-def]
    """Share [0..1] of the full speed, `since` [s] after the start."""
    if since <= 0.0 or since >= duration:
        return 0.0
    return 0.5 * (1.0 - math.cos(2.0 * math.pi * since / duration))
