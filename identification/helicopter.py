"""Helicopters: motion by the sensors, forces by the model along it."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightlog.tables import Table
from identification import evidence as ev
from identification import kinematics as k
from identification.bench import Baseline, Bench, Channel
from identification.causes.contract import Cause
from identification.drive import Noise, drive
from identification.dynamics import CHANNELS, UNITS
from identification.flight import Flight, prepare
from identification.model import Model
from identification.stack import Rows
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]

START = Noise(
    gust_std=(0.33, 0.33, 0.3), gust_tau=5.0, process=(0.0, 0.0, 0.0, 2e-3, 1e-3, 1e-3, 0.05),
    noise=(0.05, 0.05, 0.05, 1e-3, 1e-3, 1e-3, 0.22),
)  # fmt: skip
ROUNDS = 3  # of the noise fit
WIND_LEFT = 1.0  # [m/s] by which the mean wind may be off where the model was linearised

SCALAR_UNITS = {"gps": "m", "baro": "m", "sonar": "m", "mag": "uT", "pad": "m"}


class HelicopterBench:
    """Flights of one helicopter; see `identification.bench.Bench`."""

    def __init__(
        self, logs: Mapping[str, Mapping[str, Table]], vehicle: Vehicle, like: "HelicopterBench | None" = None
    ) -> None:
        """Prepare the flights and fit the noise; UserError for a log that cannot carry a diagnosis."""
        self.vehicle = vehicle
        self.names: Sequence[str] = list(logs)
        self.model = Model(vehicle)
        self.flights: list[Flight] = [prepare(name, tables, vehicle) for name, tables in logs.items()]
        topics = set.intersection(*(set(tables) for tables in logs.values()))
        self.causes: Sequence[Cause]
        self.causes, self.not_testable = ev.testable(vehicle, topics)
        self.channels: Mapping[int, Channel] = {
            **{i: Channel(name, SCALAR_UNITS[name.partition(".")[0]]) for i, name in enumerate(k.CHANNELS)},
            **{100 + i: Channel(name, unit) for i, (name, unit) in enumerate(zip(CHANNELS, UNITS, strict=True))},
        }
        self._describe()
        self._slopes: dict[int, dict[str, Floats]] = {}  # by flight, of the last time they were taken
        self._by_wind: dict[int, Floats] = {}
        noise: Noise = like.noise if like is not None else START
        spread = float(vehicle.document["environment"]["wind_std"]["value"])
        self.winds = [ev.winds(self.model, flight, noise, spread) for flight in self.flights]
        self.noise: Noise = noise if like is not None else self._fit_noise()
        self.baseline = Baseline(True, None)

    def rows(self, flight: int, changes: Mapping[str, float], fresh: Collection[str] = ()) -> Rows:
        """See `Bench.rows`."""
        knobs = {key: value for key, value in changes.items() if key in self.model.knobs}
        item, wind = self.flights[flight], self.winds[flight]
        driven = drive(self.model, item, wind, self.noise, knobs)
        if flight not in self._slopes:
            self._slopes[flight] = ev.knob_slopes(self.model, item, wind, self._knob_keys, knobs)
            self._by_wind[flight] = ev.wind_slopes(self.model, item, wind, knobs)
        elif fresh:
            wanted = [key for key in self._knob_keys if key in fresh]
            self._slopes[flight] |= ev.knob_slopes(self.model, item, wind, wanted, knobs)
        found = ev.whiten(
            self.model, driven, self.causes, self.noise, self._slopes[flight], self._by_wind[flight], WIND_LEFT
        ).rows
        residual = found.residual
        for key in changes.keys() - knobs.keys():  # what a sensor adds is linear
            residual = residual - found.signatures[key] * (changes[key] - self.nominal[key])
        return Rows(residual, found.signatures, found.local, found.local_std, found.channel, found.t)

    def bounded(self, key: str, value: float) -> float:
        """See `Bench.bounded`."""
        knob = self.model.knobs.get(key)
        return value if knob is None else min(max(value, knob.low), knob.high)

    def _describe(self) -> None:
        own = {p.key: p for cause in self.causes for p in cause.parameters}
        knobs = self.model.knobs
        self._knob_keys = sorted({*(key for key in own if key in knobs), *(kn.key for kn in self.model.toleranced)})
        self.nominal: Mapping[str, float] = {
            **{key: self._sensor_nominal(key, p.nominal) for key, p in own.items() if key not in knobs},
            **{key: knobs[key].nominal for key in self._knob_keys},
        }
        self.units: Mapping[str, str] = {
            **{key: p.unit for key, p in own.items()}, **{key: knobs[key].unit for key in self._knob_keys}
        }  # fmt: skip
        self.tolerances, self.spreads = ev.priors(self.model, self.causes)

    def _sensor_nominal(self, key: str, declared: float) -> float:
        """What the vehicle file says; what the cause declares where the file is silent."""
        section, topic, name = key.split(".")
        if section == "sensors" and topic in self.vehicle.sensors:
            return float(self.vehicle.sensors[topic].numbers.get(name, declared))
        return declared

    def _fit_noise(self) -> Noise:
        """Noise levels from what is left after everything that has a name was taken out."""
        noise = START
        for _ in range(ROUNDS):
            found = [
                ev.gather(self.model, flight, self.causes, noise, wind, WIND_LEFT)
                for flight, wind in zip(self.flights, self.winds, strict=True)
            ]
            left = [ev.unexplained(item, self.tolerances, self.spreads) for item in found]
            noise = ev.refined(noise, found, left)
        return noise


def open_bench(
    logs: Mapping[str, Mapping[str, Table]], vehicle: Vehicle, like: Bench | None = None
) -> HelicopterBench:
    """See `identification.bench.OpenBench`."""
    return HelicopterBench(logs, vehicle, like if isinstance(like, HelicopterBench) else None)
