"""Ultrasonic ranger looking down along body -z.

The echo comes from the nearest ground inside the beam: up to half the beam's angle of tilt that is the point straight
below, so the range is the height itself; beyond, it is h / cos(tilt - half angle). Out of reach there is no echo
(`valid` false, range NaN), or now and then one from nowhere, which the device holds for good: a uniformly
distributed range that is marked valid.
"""

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from flightlog.signals import SonarSample
from sim.parameters import Parameter
from sim.sensors.contract import Floats, Site, Truth
from sim.sensors.device import CLOCK, LATENCY, RATE, Device
from sim.sensors.noise import Normals


class Sonar(Device):
    """Range to the ground along the beam."""

    topic: ClassVar[str] = "sonar"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        RATE,
        LATENCY,
        CLOCK,
        Parameter("least_range", "m", 0.0, 1.0, "nearest echo that the device can tell from its own pulse"),
        Parameter("greatest_range", "m", 0.5, 20.0, "farthest echo"),
        Parameter("noise_share", "1", 0.0, 0.5, "white noise over the range"),
        Parameter("resolution", "m", 0.0, 0.5, "ranges are whole multiples of this"),
        Parameter("beam_half_angle", "rad", 0.0, 1.0, "half the opening of the beam"),
        Parameter("scale_std", "1", 0.0, 0.2, "error of the assumed speed of sound, drawn per flight"),
        Parameter("dropout_share", "1", 0.0, 1.0, "of the samples within reach that have no echo"),
        Parameter("false_echo_share", "1", 0.0, 1.0, "of the samples out of reach that show a false echo"),
        Parameter("scale", "1", 0.1, 10.0, "fixed scale, measured over true", 1.0),
    )
    ERRORS: ClassVar[tuple[tuple[str, str], ...]] = (("scale", "1"), ("false_echo", "1"))

    def __init__(self, numbers: Mapping[str, float], position: Floats, site: Site, rng: np.random.Generator) -> None:
        """Draws the scale of the flight."""
        super().__init__(numbers, position, site, rng)
        self._scale = float(rng.standard_normal())  # in standard deviations
        self._normals = Normals(rng, 1)
        self._error = (1.0, 0.0)

    def _echo(self, truth: Truth) -> float:
        """Distance [m] of the nearest ground inside the beam; inf where it looks past the horizon."""
        height = float(truth.position[2]) + self.height_of_mount(truth.rotation)
        tilt = math.acos(min(1.0, max(-1.0, float(truth.rotation[2, 2]))))
        slant = max(0.0, tilt - self.numbers["beam_half_angle"])
        return height / math.cos(slant) if slant < 0.5 * math.pi else math.inf

    def sample(self, truth: Truth) -> SonarSample:
        """The range [m] at `truth`."""
        n = self.numbers
        # always the same draws, so that one changed number does not shift all that follows
        normal = self._normals.draw()[0]
        lost, false, where = self.rng.random(3).tolist()
        scale = n["scale"] + n["scale_std"] * self._scale
        least, greatest, step = n["least_range"], n["greatest_range"], n["resolution"]
        value = scale * self._echo(truth)
        valid = least <= value <= greatest and lost >= n["dropout_share"]
        false_echo = value > greatest and false < n["false_echo_share"]
        self._error = (scale, float(false_echo))
        if false_echo:
            value = least + (greatest - least) * where
        elif valid:
            value *= 1.0 + n["noise_share"] * normal
        else:
            return SonarSample(truth.t, math.nan, False)
        if step > 0.0:
            value = step * round(value / step)
        return SonarSample(truth.t, value, True)

    def errors(self) -> tuple[float, ...]:
        """Scale in force, and 1 where the last echo was a false one."""
        return self._error
