"""Differential GPS: position of the antenna with a bias of the flight, a slow wander and white noise; late.

The published flights show a nearly constant offset with a small spread (Lei 2012, stairs: mean 0.76 m, std 0.165 m),
so bias and Gauss-Markov wander (multipath, troposphere, datum) carry most of the error and the white part little.
Wander and white noise grow with hdop, which follows from the number of satellites in view.
"""

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from flightlog.signals import GpsSample
from sim.parameters import Parameter
from sim.sensors.contract import Floats, Site, Truth
from sim.sensors.device import RATE, Device
from sim.sensors.noise import Normals, gauss_markov

NAN = math.nan
LEAST_SATELLITES = 4  # for a position and the receiver's clock
USUAL_SATELLITES = 9  # the errors and hdop are stated for so many


class Gps(Device):
    """Position and velocity of the antenna, ENU from the pad's centre."""

    topic: ClassVar[str] = "gps"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        RATE,
        Parameter("latency", "s", 0.0, 2.0, "from the time of validity to the arrival, as the maker states it"),
        Parameter("bias_std", "m", 0.0, 50.0, "bias of east and of north, drawn per flight"),
        Parameter("bias_std_up", "m", 0.0, 50.0, "bias of the height, drawn per flight"),
        Parameter("wander_std", "m", 0.0, 50.0, "Gauss-Markov wander of east and of north"),
        Parameter("wander_std_up", "m", 0.0, 50.0, "Gauss-Markov wander of the height"),
        Parameter("wander_tau", "s", 1.0, 1e5, "time constant of the wander"),
        Parameter("noise", "m", 0.0, 20.0, "white noise of east and of north"),
        Parameter("noise_up", "m", 0.0, 20.0, "white noise of the height"),
        Parameter("velocity_noise", "m/s", 0.0, 5.0, "white noise of each velocity"),
        Parameter("satellites", "1", 0.0, 40.0, "in view on the average"),
        Parameter("satellites_std", "1", 0.0, 10.0, "their coming and going"),
        Parameter("hdop", "1", 0.3, 50.0, "dilution with nine satellites, for which the errors are stated"),
        Parameter("delay", "s", 0.0, 2.0, "more latency than the receiver knows: its stamps are late by this", 0.0),
        Parameter("bias_e", "m", -1000.0, 1000.0, "fixed bias", 0.0),
        Parameter("bias_n", "m", -1000.0, 1000.0, "fixed bias", 0.0),
        Parameter("bias_u", "m", -1000.0, 1000.0, "fixed bias", 0.0),
        Parameter("drift_rate_e", "m/s", -10.0, 10.0, "steady drift since the start", 0.0),
        Parameter("drift_rate_n", "m/s", -10.0, 10.0, "steady drift since the start", 0.0),
        Parameter("drift_rate_u", "m/s", -10.0, 10.0, "steady drift since the start", 0.0),
    )
    ERRORS: ClassVar[tuple[tuple[str, str], ...]] = (("e", "m"), ("n", "m"), ("u", "m"))

    def __init__(self, numbers: Mapping[str, float], position: Floats, site: Site, rng: np.random.Generator) -> None:
        """Draws the bias of the flight; wander and satellites start anywhere in their range."""
        super().__init__(numbers, position, site, rng)
        self._bias: list[float] = rng.standard_normal(3).tolist()  # in standard deviations, as the next two
        self._wander: list[float] = rng.standard_normal(3).tolist()
        self._sky = float(rng.standard_normal())
        self._ramp = [0.0, 0.0, 0.0]
        self._normals = Normals(rng, 10, rows=64)
        self._error = (0.0, 0.0, 0.0)

    def sample(self, truth: Truth) -> GpsSample:
        """The fix whose time of validity is `truth`."""
        n, z = self.numbers, self._normals.draw()
        dt = self.elapsed(truth.t)
        tau = n["wander_tau"]
        self._sky = gauss_markov(self._sky, 1.0, tau, dt, z[9])
        wander, ramp, bias = self._wander, self._ramp, self._bias
        for i, axis in enumerate("enu"):
            wander[i] = gauss_markov(wander[i], 1.0, tau, dt, z[i])
            ramp[i] += n["drift_rate_" + axis] * dt
        t = truth.t + n["delay"]
        satellites = max(0, round(n["satellites"] + n["satellites_std"] * self._sky))
        if satellites < LEAST_SATELLITES:
            self._error = (NAN, NAN, NAN)
            return GpsSample(t, t + n["latency"], NAN, NAN, NAN, NAN, NAN, NAN, satellites, NAN, False)
        dilution = math.sqrt(USUAL_SATELLITES / satellites)
        side, up = n["wander_std"], n["wander_std_up"]
        e = n["bias_e"] + ramp[0] + n["bias_std"] * bias[0] + dilution * side * wander[0]
        north = n["bias_n"] + ramp[1] + n["bias_std"] * bias[1] + dilution * side * wander[1]
        u = n["bias_u"] + ramp[2] + n["bias_std_up"] * bias[2] + dilution * up * wander[2]
        self._error = (e, north, u)
        # the antenna: p + R r, v + R (omega x r)
        (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = truth.rotation.tolist()
        px, py, pz = truth.position.tolist()
        vx, vy, vz = truth.velocity.tolist()
        wx, wy, wz = truth.rates.tolist()
        x, y, h = self.position
        sx, sy, sz = wy * h - wz * y, wz * x - wx * h, wx * y - wy * x
        white, white_up = dilution * n["noise"], dilution * n["noise_up"]
        speed = dilution * n["velocity_noise"]
        return GpsSample(
            t,
            t + n["latency"],
            px + r00 * x + r01 * y + r02 * h + e + white * z[3],
            py + r10 * x + r11 * y + r12 * h + north + white * z[4],
            pz + r20 * x + r21 * y + r22 * h + u + white_up * z[5],
            vx + r00 * sx + r01 * sy + r02 * sz + speed * z[6],
            vy + r10 * sx + r11 * sy + r12 * sz + speed * z[7],
            vz + r20 * sx + r21 * sy + r22 * sz + speed * z[8],
            satellites,
            n["hdop"] * dilution,
            True,
        )

    def errors(self) -> tuple[float, ...]:
        """Position error without its white part [m]; NaN without a fix."""
        return self._error
