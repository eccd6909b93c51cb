"""One flight against the model: innovations of force, moment and rotor, and what a gust does to them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.dynamics import innovations
from identification.flight import Flight
from identification.gusts import Gusts
from identification.model import Model
from identification.whitening import drive_signatures

Floats = NDArray[np.float64]

PUFF = 0.5  # [m/s] for the derivative by the wind


@dataclass(frozen=True)
class Noise:
    """What the model leaves open, along all flights."""

    gust_share: tuple[float, float, float] = (1.0, 1.0, 1.0)  # of what belongs to the mean wind: east, north, up
    process: tuple[float, ...] = (0.0, 0.0, 0.0, 0.02, 0.02, 0.02, 0.3)  # of rates and rotor speed, a node
    noise: tuple[float, ...] = (0.1, 0.1, 0.15, 0.005, 0.005, 0.005, 0.3)  # of force, rate, rotor speed


@dataclass(frozen=True, eq=False)
class Driven:
    """A flight with the model's answer and its innovations."""

    flight: Flight
    wind: Floats  # (3,) [m/s] mean
    answer: Floats  # (N, 7)
    gust: Gusts
    gains: Floats  # (N, 7, 7)
    spreads: Floats  # (N, 7)
    residual: Floats  # (N, 7) innovations over their standard deviation
    cost: float  # twice the negative log-likelihood

    def whiten(self, model: Floats, measured: Floats | None = None) -> Floats:
        """Whitened change (N, 7, C) of the innovations if the model's answer changes by `model` (N, 7, C)."""
        measured = np.zeros_like(model) if measured is None else measured
        step = self.flight.motion.step
        return np.asarray(
            drive_signatures(
                self.gust.slopes, self.gains, self.spreads, step, self.gust.keep, np.ascontiguousarray(model),
                np.ascontiguousarray(measured),
            )
        )  # fmt: skip


def gust_slopes(model: Model, flight: Flight, wind: Floats, changes: Mapping[str, float] | None = None) -> Floats:
    """Derivative (N, 7, 3) of the answer by the wind."""
    puffs = PUFF * np.vstack([np.eye(3), -np.eye(3)])
    runs = model.answers(flight.drive, [(wind, changes or {}, puff) for puff in puffs])
    return np.stack([(runs[i] - runs[3 + i]) / (2.0 * PUFF) for i in range(3)], axis=-1)


def judge(flight: Flight, wind: Floats, answer: Floats, gust: Gusts, noise: Noise) -> Driven:
    """Innovations of an answer (N, 7)."""
    nodes = len(answer)
    gains, spreads, out = np.zeros((nodes, 7, 7)), np.zeros((nodes, 7)), np.zeros((nodes, 7))
    step = flight.motion.step
    cost = innovations(
        answer, flight.measured, gust.slopes, step, gust.keep, gust.std * noise.gust_share, np.array(noise.process),
        np.array(noise.noise), gains, spreads, out,
    )  # fmt: skip
    return Driven(flight, wind, answer, gust, gains, spreads, out / spreads, float(cost))
