"""Static pressure and the height that equation 8 makes of it.

Chain: air at the port (undisturbed pressure at its height + the wind's suction + the rotor's downwash) -> first-order
lag of the tubing -> the device's offset, bias, drift and white noise. Errors are given in metres of height, positive
where the altitude reads high, because that is how they are met; the pressure moves by -rho g times that.

Before the flight the same device read pressure and temperature on the pad, and these are the P_b and T_b of the
`altitude` column. The device's offset (of the order of a hectopascal) cancels by that; what has changed since then,
warm-up and weather, is `bias_std`, and `drift` begins at zero with the flight. `pad_pressure` and `pad_temperature`
are what was read, reduced from the port to the ground, so that the altitude is that of the port above the pad.

Under a rotor near the ground the downwash is stopped and the pressure around the fuselage rises by a share of the
disc loading: the altitude reads LOW. The share falls off with the skids' height h as exp(-h / height_scale).
"""

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from flightlog.atmosphere import height_from_pressure, pressure_at
from flightlog.constants import GAS_CONSTANT, GRAVITY, LAPSE_RATE
from flightlog.signals import BaroSample
from sim.parameters import Parameter
from sim.sensors.contract import Floats, Site, Truth
from sim.sensors.device import CLOCK, LATENCY, RATE, Device
from sim.sensors.noise import Normals, gauss_markov


class Barometer(Device):
    """Pressure, its temperature and the height of the port above the pad."""

    topic: ClassVar[str] = "baro"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        RATE,
        LATENCY,
        CLOCK,
        Parameter("noise", "m", 0.0, 10.0, "white noise"),
        Parameter("bias_std", "m", 0.0, 20.0, "change between the pad's reading and the start, drawn per flight"),
        Parameter("drift_std", "m", 0.0, 20.0, "Gauss-Markov drift in flight, zero at the start"),
        Parameter("drift_tau", "s", 1.0, 1e5, "its time constant"),
        Parameter("lag", "s", 0.0, 10.0, "first-order lag of port and tubing"),
        Parameter("downwash_gain", "1", -5.0, 5.0, "pressure rise at touchdown over the disc loading"),
        Parameter("downwash_height_scale", "m", 0.01, math.inf, "height in which the rise falls by e; inf: everywhere"),
        Parameter("port_coefficient", "1", -2.0, 2.0, "pressure coefficient of the port in the wind"),
        Parameter("offset_std", "Pa", 0.0, 1000.0, "offset of the device, per flight; the pad's reading has it too"),
        Parameter("temperature_bias_std", "K", 0.0, 20.0, "error of the thermometer, drawn per flight"),
        Parameter("temperature_noise", "K", 0.0, 5.0, "white noise of the temperature"),
        Parameter("bias", "m", -100.0, 100.0, "fixed bias", 0.0),
        Parameter("drift_rate", "m/s", -10.0, 10.0, "steady drift since the start", 0.0),
        Parameter("glitch_count", "1", 0.0, 1e4, "jumps in a flight, each of which comes back", 0.0),
        Parameter("glitch_size", "m", -1e4, 1e4, "of a jump", 0.0),
        Parameter("glitch_first", "s", 0.0, 1e5, "when the first begins", 0.0),
        Parameter("glitch_every", "s", 0.1, 1e5, "from one to the next", 5.0),
        Parameter("glitch_length", "s", 0.0, 100.0, "for which a jump lasts", 0.1),
    )
    ERRORS: ClassVar[tuple[tuple[str, str], ...]] = (
        ("bias", "m"), ("drift", "m"), ("downwash", "m"), ("port", "m"), ("glitch", "m"),
    )  # fmt: skip

    pad_pressure: float  # [Pa] P_b as read on the pad, at the ground
    pad_temperature: float  # [K] T_b

    def __init__(self, numbers: Mapping[str, float], position: Floats, site: Site, rng: np.random.Generator) -> None:
        """Draws offset and bias of the flight and reads the pad."""
        super().__init__(numbers, position, site, rng)
        offset, self._bias, thermometer = rng.standard_normal(3).tolist()  # in standard deviations
        self._offset = self.numbers["offset_std"] * offset
        self._thermometer = self.numbers["temperature_bias_std"] * thermometer
        self._area = math.pi * site.rotor_radius**2
        self._drift = 0.0
        self._ramp = 0.0
        self._lagged = math.nan
        self._normals = Normals(rng, 3)
        self._error = (0.0, 0.0, 0.0, 0.0, 0.0)
        standing = site.skid_height + self.position[2]  # the port above the ground before the flight
        read = pressure_at(standing, site.surface_pressure, site.surface_temperature) + self._offset
        self.pad_temperature = site.surface_temperature + self._thermometer
        self.pad_pressure = float(pressure_at(-standing, read, self.pad_temperature + LAPSE_RATE * standing))

    def sample(self, truth: Truth) -> BaroSample:
        """Pressure [Pa], temperature [K] and altitude [m] at `truth`."""
        n, z = self.numbers, self._normals.draw()
        dt = self.elapsed(truth.t)
        density = truth.pressure / (GAS_CONSTANT * truth.temperature)
        weight = density * GRAVITY  # [Pa/m]
        skids = max(0.0, float(truth.position[2]) - self.site.skid_height)
        loading = truth.thrust / self._area
        downwash = n["downwash_gain"] * loading * math.exp(-skids / n["downwash_height_scale"])
        vx, vy, _ = truth.velocity.tolist()
        wx, wy, _ = truth.wind.tolist()
        port = n["port_coefficient"] * 0.5 * density * ((vx - wx) ** 2 + (vy - wy) ** 2)
        pressure = truth.pressure - weight * self.height_of_mount(truth.rotation) + downwash + port
        lag = n["lag"]
        if lag > 0.0 and not math.isnan(self._lagged):
            pressure += (self._lagged - pressure) * math.exp(-dt / lag)
        self._lagged = pressure
        self._drift = gauss_markov(self._drift, n["drift_std"], n["drift_tau"], dt, z[0])
        self._ramp += n["drift_rate"] * dt
        bias = n["bias"] + n["bias_std"] * self._bias
        drift = self._drift + self._ramp
        glitch = self._glitch(truth.t)
        pressure += self._offset - weight * (bias + drift + glitch + n["noise"] * z[1])
        temperature = truth.temperature + self._thermometer + n["temperature_noise"] * z[2]
        self._error = (bias, drift, -downwash / weight, -port / weight, glitch)
        altitude = height_from_pressure(pressure, self.pad_pressure, self.pad_temperature)
        return BaroSample(truth.t, pressure, temperature, altitude)

    def _glitch(self, t: float) -> float:
        """What a jump adds to the height [m] at time t [s]."""
        n = self.numbers
        since = t - n["glitch_first"]
        if since < 0.0 or since >= n["glitch_count"] * n["glitch_every"]:
            return 0.0
        return n["glitch_size"] if since % n["glitch_every"] < n["glitch_length"] else 0.0

    def errors(self) -> tuple[float, ...]:
        """What each fault adds to the altitude [m]; downwash and port before the lag."""
        return self._error
