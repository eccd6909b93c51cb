"""The moving air: mean wind with its profile, Dryden turbulence, gusts."""

import math
from dataclasses import astuple

import numba
import numpy as np
from numpy.typing import NDArray

from sim.weather import Weather
from sim.wind import dryden
from sim.wind.gust import Gust, shape
from sim.wind.mean import FOOT, mean_speed, sheared_speed

__all__ = ["Gust", "Wind"]

Floats = NDArray[np.float64]

_BLOCK = 1024  # steps' worth of normals drawn at once


@numba.njit(
    "void(float64[::1], float64[::1], float64[:, ::1], float64, float64, float64, float64, float64, float64, float64,"
    " float64, float64, float64[::1])",
    cache=True,
)
def _air(x, normals, gusts, speed, shear, stirring, wind_from, scale, height, airspeed, dt, t, air):  # type: ignore[no-untyped-def]
    """Step the turbulence and write the air's velocity (3,) [m/s] ENU into `air`."""
    along, left, up = 0.0, 0.0, 0.0
    if scale > 0.0:
        along, left, up = dryden.step(x, normals, height, stirring, airspeed, dt)
    along = scale * along + sheared_speed(height, speed, shear)
    left *= scale
    east, north = -math.sin(wind_from), -math.cos(wind_from)
    air[0] = along * east - left * north
    air[1] = along * north + left * east
    air[2] = scale * up
    for i in range(len(gusts)):
        share = shape(t - gusts[i, 0], gusts[i, 1])
        air[0] -= share * gusts[i, 2] * math.sin(gusts[i, 3])
        air[1] -= share * gusts[i, 2] * math.cos(gusts[i, 3])
        air[2] += share * gusts[i, 4]


class Wind:
    """The air of one flight, frozen in itself and carried past the vehicle."""

    def __init__(self, weather: Weather, generator: np.random.Generator, turbulence_scale: float = 1.0) -> None:
        """Turbulence of `weather` times `turbulence_scale`, drawn from `generator`."""
        self.speed = weather.wind  # [m/s] mean at 10 m
        self.shear = weather.shear
        self.wind_from = weather.wind_from  # [rad] clockwise from north
        self.scale = 0.0 if weather.turbulence == "none" else turbulence_scale
        # mean wind at 10 m [m/s] that a class's strength belongs to; None: the wind that blows
        self._stirring: float | None = None
        if weather.turbulence in dryden.CLASSES:
            self._stirring = dryden.CLASSES[weather.turbulence] / mean_speed(20.0 * FOOT, 1.0)
        self._gusts: Floats = np.empty((0, 5))
        self._generator = generator
        self._normals: Floats = np.empty((0, dryden.NORMALS))
        self._next = 0
        self._state: Floats = np.zeros(dryden.STATES)
        self._velocity: Floats = np.zeros(3)
        dryden.start(self._state, generator.standard_normal(dryden.STATES))

    def set_mean(self, speed: float, wind_from: float) -> None:
        """Change the mean wind at 10 m [m/s] and where it comes from [rad, clockwise from north].

        Turbulence of the kind "dryden" takes the strength that belongs to it, that of a class keeps its own.
        """
        self.speed, self.wind_from = speed, wind_from

    def add(self, gust: Gust) -> None:
        """Let a gust come."""
        self._gusts = np.vstack([self._gusts, astuple(gust)])

    def mean(self, height: float) -> Floats:
        """Mean wind (3,) [m/s] ENU, where the air moves to, at `height` [m] above the ground."""
        speed = sheared_speed(height, self.speed, self.shear)
        return np.array([-speed * math.sin(self.wind_from), -speed * math.cos(self.wind_from), 0.0])

    def step(self, height: float, airspeed: float, dt: float, t: float) -> Floats:
        """Velocity of the air (3,) [m/s] ENU at time t [s]; the same array every time.

        height [m] above the ground; airspeed [m/s] of the vehicle relative to the mean wind; dt [s] since the last
        step.
        """
        if self._next == len(self._normals):
            self._normals = self._generator.standard_normal((_BLOCK, dryden.NORMALS))
            self._next = 0
        normals = self._normals[self._next]
        self._next += 1
        _air(
            self._state, normals, self._gusts, self.speed, self.shear,
            self.speed if self._stirring is None else self._stirring, self.wind_from, self.scale, height, airspeed,
            dt, t, self._velocity,
        )  # fmt: skip
        return self._velocity
