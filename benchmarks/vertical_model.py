"""Identify Lei 2012's equation 13 on the Raptor 90: fly it, fit the fifteen coefficients, try them on another flight.

python benchmarks/vertical_model.py [generations, default 60]

Three flights of a minute in still air, with slow and quick strokes of collective and throttle laid over the pilot's;
then a fourth with other strokes, in still air and in the default wind. The rates compared are the navigator's.
What is printed first stands in `estimators/vertical_model.py`.
"""

import math
import sys
import tempfile
from pathlib import Path

import numpy as np

from estimators.vertical_fit import STEP, VerticalLog, errors, fit_vertical_model
from estimators.vertical_model import PALLETT, RAPTOR90, VerticalModel
from flightlog.readers.folder import read_flight
from flightlog.signals import Controls, StateEstimate
from scenarios.crew import make_pilot
from scenarios.flight import fly
from scenarios.load import load

SETTLED = 3.0  # [s]


class Shaken:
    """A pilot with strokes laid over its collective and throttle."""

    def __init__(self, pilot, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self._pilot = pilot
        self._omega = 2.0 * math.pi / np.geomspace(0.4, 9.0, 7)
        self._phase = rng.uniform(0.0, 2.0 * math.pi, (2, 7))
        self._size = np.array([[math.radians(0.45)], [0.05]]) * np.geomspace(0.6, 1.0, 7)

    def __getattr__(self, name: str):
        return getattr(self._pilot, name)

    def update(self, state: StateEstimate) -> Controls:
        sent = self._pilot.update(state)
        collective, throttle = (self._size * np.sin(self._omega * state.t + self._phase)).sum(axis=1)
        return sent._replace(
            collective=sent.collective + float(collective), throttle=min(1.0, max(0.0, sent.throttle + float(throttle)))
        )


def flown(seed: int, wind: bool) -> VerticalLog:
    changes = {} if wind else {"weather.wind_m_s": 0.0, "weather.turbulence": "none"}
    scenario = load("hover", changes)
    with tempfile.TemporaryDirectory() as folder:
        flight = Path(folder) / "flight"
        fly(scenario, seed=seed, folder=flight, cameras=False, pilot=lambda *a: Shaken(make_pilot(*a), seed))
        tables = read_flight(flight).measured
        return VerticalLog.of(tables, SETTLED, scenario.duration_s - 1.0)


def show(name: str, model: VerticalModel, logs: list[VerticalLog]) -> None:
    for span in (1.0, 3.0):
        climb, speed = errors(model, logs, span)
        still = math.sqrt(np.mean([np.mean((g.climb[round(span / STEP):] - g.climb[:-round(span / STEP)]) ** 2)
                                   for g in logs]))  # fmt: skip
        print(f"{name:34s} {span:.0f} s free: climb {climb:.3f} m/s RMS (it changes by {still:.3f}), "
              f"rotor {speed:.2f} rad/s")  # fmt: skip


def main(generations: int) -> None:
    train = [flown(seed, wind=False) for seed in (1, 2, 3)]
    fit = fit_vertical_model(train, seed=0, generations=generations)
    print("a =", np.array2string(fit.model.a, separator=", ", formatter={"float": lambda x: f"{x:.6g}"}))
    print(f"throttle_gain = {fit.model.throttle_gain:.6g}, collective_gain = {fit.model.collective_gain:.6g}")
    show("fitted flights", fit.model, train)
    calm, windy = [flown(4, wind=False)], [flown(5, wind=True)]
    show("another flight, still air", fit.model, calm)
    show("another flight, default wind", fit.model, windy)
    show("as it stands in the project, wind", RAPTOR90, windy)
    show("Pallett's X-Cell 50 on its stand", PALLETT, windy)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
