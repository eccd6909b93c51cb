"""Three-axis magnetometer after its calibration on the ground.

measured = misaligned(field of the site in body axes) + what hard iron the calibration left + drift + white noise.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from flightlog.signals import MagSample
from sim.parameters import Parameter
from sim.sensors.contract import Floats, Site, Truth
from sim.sensors.device import CLOCK, LATENCY, RATE, Device
from sim.sensors.noise import Normals, gauss_markov


class Magnetometer(Device):
    """The earth's field in body axes."""

    topic: ClassVar[str] = "mag"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        RATE,
        LATENCY,
        CLOCK,
        Parameter("noise", "uT", 0.0, 10.0, "white noise of an axis"),
        Parameter("bias_std", "uT", 0.0, 50.0, "hard iron left by the calibration, drawn per flight and axis"),
        Parameter("drift_std", "uT", 0.0, 10.0, "Gauss-Markov drift: currents and temperature"),
        Parameter("drift_tau", "s", 1.0, 1e5, "its time constant"),
        Parameter("misalignment_std", "rad", 0.0, 0.2, "turn of the case against the body, drawn per flight and axis"),
        Parameter("bias_x", "uT", -50.0, 50.0, "fixed bias", 0.0),
        Parameter("bias_y", "uT", -50.0, 50.0, "fixed bias", 0.0),
        Parameter("bias_z", "uT", -50.0, 50.0, "fixed bias", 0.0),
    )
    ERRORS: ClassVar[tuple[tuple[str, str], ...]] = (("bias_x", "uT"), ("bias_y", "uT"), ("bias_z", "uT"))

    def __init__(self, numbers: Mapping[str, float], position: Floats, site: Site, rng: np.random.Generator) -> None:
        """Draws bias and misalignment of the flight; the drift starts anywhere in its range."""
        super().__init__(numbers, position, site, rng)
        self._field: tuple[float, ...] = tuple(np.asarray(site.magnetic_field, float).tolist())
        self._bias: list[float] = rng.standard_normal(3).tolist()  # in standard deviations, as the turn
        self._turn: list[float] = rng.standard_normal(3).tolist()
        self._drift: list[float] = (self.numbers["drift_std"] * rng.standard_normal(3)).tolist()
        self._normals = Normals(rng, 6)
        self._error = (0.0, 0.0, 0.0)

    def sample(self, truth: Truth) -> MagSample:
        """The field [uT] in body axes at `truth`."""
        n, z = self.numbers, self._normals.draw()
        std, tau, white, bias_std, turn_std = (
            n["drift_std"], n["drift_tau"], n["noise"], n["bias_std"], n["misalignment_std"],
        )  # fmt: skip
        (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = truth.rotation.tolist()
        e, north, up = self._field
        x = r00 * e + r10 * north + r20 * up
        y = r01 * e + r11 * north + r21 * up
        h = r02 * e + r12 * north + r22 * up
        # a case turned by the small vector a sees v - a x v
        ax, ay, az = self._turn
        x, y, h = (
            x - turn_std * (ay * h - az * y),
            y - turn_std * (az * x - ax * h),
            h - turn_std * (ax * y - ay * x),
        )
        drift, dt = self._drift, self.elapsed(truth.t)
        for i in range(3):
            drift[i] = gauss_markov(drift[i], std, tau, dt, z[i])
        bx = n["bias_x"] + bias_std * self._bias[0] + drift[0]
        by = n["bias_y"] + bias_std * self._bias[1] + drift[1]
        bz = n["bias_z"] + bias_std * self._bias[2] + drift[2]
        self._error = (bx, by, bz)
        return MagSample(truth.t, x + bx + white * z[3], y + by + white * z[4], h + bz + white * z[5])

    def errors(self) -> tuple[float, ...]:
        """Bias of each axis: fixed, drawn and drifted."""
        return self._error
