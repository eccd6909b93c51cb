"""Logs of a multirotor as a small autopilot keeps them, made by other equations than those that judge them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from flightlog.tables import Table, table

Floats = NDArray[np.float64]

FINE = 0.02  # [s]


@dataclass(frozen=True, eq=False)
class Made:
    """A log's columns, for a fault to be put in, and the true height."""

    columns: dict[str, dict[str, Floats]]
    t: Floats
    height: Floats

    def tables(self) -> Mapping[str, Table]:
        """As a reader gives them."""
        return {
            topic: table("measured", topic, list(zip(*columns.values(), strict=True)), columns)
            for topic, columns in self.columns.items()
        }


def everyday(seed: int, *, duration: float | None = None, doppler: bool = True, barometers: int = 1,
             sonar: bool = True) -> Made:  # fmt: skip
    """A flight from the ground to the ground on which nothing is wrong but what always is."""
    rng = np.random.default_rng(seed)
    duration = float(rng.uniform(60.0, 240.0)) if duration is None else duration
    t = np.arange(0.0, duration, FINE)
    away = (t > 8.0) & (t < duration - 8.0)
    stops = np.arange(0.0, duration + 12.0, 12.0)
    level = np.interp(t, stops, rng.uniform(1.0, 40.0, len(stops)))
    height = gaussian_filter1d(np.where(away, level, 0.0), 1.2 / FINE)
    place = gaussian_filter1d(np.where(away, np.interp(t, stops, rng.normal(0.0, 30.0, len(stops))), 0.0), 1.5 / FINE)
    climb, speed = np.gradient(height, FINE), np.gradient(place, FINE)
    throttle = np.where(away, 0.4 + 0.05 * np.gradient(climb, FINE) + 0.02 * rng.standard_normal(len(t)), 0.0)
    throttle = np.clip(throttle, 0.0, 1.0)

    def wander(size: float, lasting: float) -> Floats:
        """Smooth, of this size, by the sum of a few waves: no Markov process."""
        periods = lasting * np.exp(rng.uniform(0.5, 2.5, 6))
        waves = np.sin(2.0 * np.pi * (t[:, None] / periods + rng.uniform(0.0, 1.0, 6)))
        return np.asarray(size * np.sqrt(2.0 / 6.0) * waves @ rng.standard_normal(6))

    columns: dict[str, dict[str, Floats]] = {}
    air = wander(0.6, 40.0)
    wash, port = rng.uniform(-3.0, 3.0), rng.normal(0.0, 0.3)
    for number in range(barometers):
        rows = slice(0, None, 5)
        felt = height + air + wander(0.3, 40.0) + wash * gaussian_filter1d(throttle, 5.0) + port * speed**2 / 19.6
        landing = rng.uniform(0.0, 3.0) * np.exp(-(((t - duration + 8.5) / 0.3) ** 2))  # the cushion at touchdown
        felt = felt + landing + rng.normal(0.0, rng.uniform(0.05, 0.25), len(t))
        name = "baro" if number == 0 else f"baro_{number + 1}"
        columns[name] = {"t": t[rows], "altitude": np.round(felt[rows], 2)}
    hdop = float(rng.uniform(0.6, 2.2))
    rows = slice(0, None, 10)
    late = np.interp(t - rng.uniform(0.1, 1.0), t, height)
    fix = late + wander(hdop * rng.uniform(0.5, 1.5), 80.0) + rng.normal(0.0, 0.05, len(t))
    columns["gps"] = {
        "t": t[rows], "e": place[rows], "n": 0.0 * place[rows], "u": np.round((fix - fix[0])[rows], 2),
        "ve": speed[rows] + 0.1 * rng.standard_normal(len(t[rows])), "vn": 0.1 * rng.standard_normal(len(t[rows])),
        "hdop": np.full(len(t[rows]), hdop), "valid": np.ones(len(t[rows])),
    }  # fmt: skip
    if doppler:
        columns["gps"]["vu"] = (climb + wander(0.03, 30.0) + 0.08 * rng.standard_normal(len(t)))[rows]
    if sonar:
        rows = slice(0, None, 5)
        ground = np.interp(place, np.linspace(-120.0, 120.0, 25), rng.normal(0.0, 1.0, 25))
        ranged = np.maximum(height - ground + ground[0], 0.15) * (1.0 + rng.normal(0.0, 0.01))
        ranged = np.minimum(ranged + 0.03 * rng.standard_normal(len(t)), 6.4)
        columns["sonar"] = {"t": t[rows], "range": ranged[rows], "valid": np.ones(len(t[rows]))}
    columns["controls"] = {"t": t[::5], "throttle": throttle[::5]}
    return Made(columns, t, height)
