"""Rotor speed from the times of magnet pulses.

A timer stamps each pulse; the speed is what the whole pulses since the last sample make of the time between them, so
it is late by a part of the sampling period, and quantised by the timer alone. With no pulse since the last sample the
speed can be no more than one pulse in the time that has passed since.
"""

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from flightlog.signals import RotorSample
from sim.parameters import Parameter
from sim.sensors.contract import Floats, Site, Truth
from sim.sensors.device import CLOCK, LATENCY, RATE, Device
from sim.sensors.noise import Normals


class Tachometer(Device):
    """Main rotor speed, never negative."""

    topic: ClassVar[str] = "rotor"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        RATE,
        LATENCY,
        CLOCK,
        Parameter("pulses", "1", 1.0, 1000.0, "for one turn of the main rotor"),
        Parameter("timer", "s", 0.0, 0.01, "resolution of a pulse's time stamp"),
        Parameter("noise_share", "1", 0.0, 0.5, "white noise over the speed: magnets not quite evenly placed"),
        Parameter("timeout", "s", 0.01, 10.0, "without a pulse for so long the speed is zero"),
        Parameter("scale", "1", 0.1, 10.0, "fixed scale, measured over true", 1.0),
    )
    ERRORS: ClassVar[tuple[tuple[str, str], ...]] = (("scale", "1"),)

    def __init__(self, numbers: Mapping[str, float], position: Floats, site: Site, rng: np.random.Generator) -> None:
        """Draws where the magnet stands."""
        super().__init__(numbers, position, site, rng)
        self._pulses = float(rng.uniform(0.0, 1.0))  # counted with their fraction
        self._counted = 0  # whole pulses up to the last stamp
        self._speed = math.nan  # true, at the last sample
        self._stamp = math.nan  # [s] of the last whole pulse
        self._measured = 0.0
        self._normals = Normals(rng, 1)

    def sample(self, truth: Truth) -> RotorSample:
        """The speed [rad/s] at `truth`."""
        n, t, speed = self.numbers, truth.t, max(0.0, truth.rotor_speed)
        noise = 1.0 + n["noise_share"] * self._normals.draw()[0]
        turn = 2.0 * math.pi / n["pulses"]  # [rad] from one pulse to the next
        first = math.isnan(self._speed)
        before = speed if first else self._speed
        mean, dt = 0.5 * (speed + before), self.elapsed(t)
        self._pulses += mean * dt / turn
        whole = math.floor(self._pulses)
        passed = whole - self._counted
        self._speed = speed
        if passed > 0 and speed > 0.0:
            timer = n["timer"]
            since = (self._pulses - whole) * turn
            back = since / speed
            # the speed changes evenly from sample to sample
            stamp = t - since / max(speed - 0.5 * back * (speed - before) / dt, 0.5 * speed)
            if timer > 0.0:
                stamp = timer * math.floor(stamp / timer)
            span = passed * turn / mean if math.isnan(self._stamp) else stamp - self._stamp
            self._stamp, self._counted = stamp, whole
            self._measured = n["scale"] * passed * turn / max(span, timer, 1e-9)
        elif not math.isnan(self._stamp):
            waited = t - self._stamp
            self._measured = 0.0 if waited > n["timeout"] else min(self._measured, n["scale"] * turn / waited)
        return RotorSample(t, self._measured * noise)

    def errors(self) -> tuple[float, ...]:
        """Scale in force."""
        return (self.numbers["scale"],)
