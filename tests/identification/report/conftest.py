"""A diagnosis that costs nothing: flights whose rows are exactly linear in every number."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import pytest

from identification.bench import Baseline, Channel
from identification.causes import CATALOGUE
from identification.diagnosis import Diagnosis, _asserted, _candidates
from identification.search import Search
from identification.stack import Rows
from identification.verdict import BaselineReport, NotTestable, Number, Verdict
from sim import vehicle

GAIN, SCALE, RATE, MASS = (
    "terms.ground_effect.gain", "terms.main_rotor.thrust_scale", "sensors.baro.drift_rate", "mass",
)  # fmt: skip
CAUSES = ("ground_effect", "thrust_scale", "baro_drift", "mass")


class LinearBench:
    """Three flights of 60 s, two channels: a force that follows the height, a height that follows the time."""

    def __init__(self, true: Mapping[str, float], flights: int = 3, seed: int = 5, landing: bool = False) -> None:
        """landing: the height only falls."""
        self.vehicle = vehicle.load("raptor90")
        self.names = [f"flight-{i}" for i in range(flights)]
        self.causes = [CATALOGUE[name] for name in CAUSES]
        self.not_testable = {"rotor_droop": ["rotor.speed"]}
        self.channels = {1: Channel("baro.altitude", "m"), 102: Channel("force_z", "m/s^2")}
        self.nominal = {GAIN: 1.0, SCALE: 1.0, RATE: 0.0, MASS: 5.0}
        self.units = {GAIN: "1", SCALE: "1", RATE: "m/s", MASS: "kg"}
        self.tolerances = {GAIN: 0.1, SCALE: 0.03, MASS: 0.05}
        self.spreads = {GAIN: 1.5, SCALE: 0.15, RATE: 0.1, MASS: 0.5}
        noise = {"baro.altitude": (0.1, "m"), "force_z": (0.05, "m/s^2")}
        self.baseline = Baseline(True, None, noise, {"wind_e": 1.0, "wind_n": 0.0, "gust_std": 0.3})
        rng = np.random.default_rng(seed)
        self._landing = landing
        self._rows = [self._fly(rng, true) for _ in range(flights)]

    def _fly(self, rng: np.random.Generator, true: Mapping[str, float]) -> tuple[Rows, Any]:
        t = np.linspace(0.0, 60.0, 600)
        height = 5.0 + 4.5 * np.cos(t / rng.uniform(4.0, 9.0))
        if self._landing:
            height = 30.0 - 0.495 * t
        nothing = np.zeros(600)
        signatures = {
            GAIN: np.append(nothing, 25.0 * np.exp(-height)),
            SCALE: np.append(nothing, np.full(600, 20.0) + height),
            RATE: np.append(t, nothing),
            MASS: np.append(nothing, np.full(600, -4.0)),
        }
        local = np.append(nothing, np.ones(600))[:, None]
        residual = rng.standard_normal(1200) + local[:, 0] * rng.normal(0.0, 0.3)
        for key, value in true.items():
            residual = residual + signatures[key] * (value - self.nominal[key])
        channel = np.repeat(np.array([1, 102]), 600)
        rows = Rows(residual, signatures, local, np.array([0.3]), channel, np.tile(t, 2))
        roll = np.sin(0.9 * t)
        drivers = {"height": ("height [m]", t, height), "roll": ("roll [deg]", t, roll), "time": ("time [s]", t, t)}
        return rows, drivers

    def rows(self, flight: int, changes: Mapping[str, float], fresh: Collection[str] = ()) -> Rows:
        r = self._rows[flight][0]
        left = r.residual.copy()
        for key, value in changes.items():
            left -= r.signatures[key] * (value - self.nominal[key])
        return Rows(left, r.signatures, r.local, r.local_std, r.channel, r.t)

    def bounded(self, key: str, value: float) -> float:
        return value

    def drivers(self, flight: int) -> Any:
        return self._rows[flight][1]


def examined(true: Mapping[str, float], flights: int = 3, seed: int = 5, landing: bool = False) -> Diagnosis:
    bench = LinearBench(true, flights, seed, landing)
    search = Search(bench)
    best = search.run()
    noise = {name: Number(value, unit) for name, (value, unit) in bench.baseline.noise.items()}
    verdict = Verdict(
        vehicle="raptor90", logs=bench.names, baseline=BaselineReport(True, None, noise, bench.baseline.environment),
        channels=[], causes=[_asserted(search, best, name) for name in best], candidates=_candidates(search, best),
        unexplained=[], not_testable=[NotTestable("rotor_droop", ["rotor.speed"])], notes=["flight-0: a <note>"],
    )  # fmt: skip
    return Diagnosis(verdict, bench, search, best)


@pytest.fixture
def diagnosed() -> Any:
    """Makes a diagnosis of linear flights whose true numbers are given."""
    return examined
