"""One flight against the model: innovations of force, moment and rotor, and what a gust does to them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.dynamics import innovations
from identification.flight import Flight
from identification.gusts import Gusts, Slopes
from identification.model import Model
from identification.whitening import drive_signatures

Floats = NDArray[np.float64]

PUFF = 0.5  # [m/s] for the derivative by the wind
EVERY = 8  # nodes, between puffs of one node: what the rotor remembers of one is over by the next
LEFT = (0.01, 0.9)  # of a force that the inflow takes away, a node later


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
    gains: Floats  # (N, 7, 10)
    spreads: Floats  # (N, 7)
    residual: Floats  # (N, 7) innovations over their standard deviation
    cost: float  # twice the negative log-likelihood

    def whiten(self, model: Floats, measured: Floats | None = None) -> Floats:
        """Whitened change (N, 7, C) of the innovations if the model's answer changes by `model` (N, 7, C)."""
        measured = np.zeros_like(model) if measured is None else measured
        step = self.flight.motion.step
        return np.asarray(
            drive_signatures(
                self.gust.slopes, self.gust.sooner, self.gust.follow, self.gains, self.spreads, step, self.gust.keep,
                np.ascontiguousarray(model), np.ascontiguousarray(measured),
            )
        )  # fmt: skip


def gust_slopes(model: Model, flight: Flight, wind: Floats, changes: Mapping[str, float] | None = None) -> Slopes:
    """Of the model's answer by the wind."""
    nodes = len(flight.motion.t)
    pulses = np.zeros((nodes, 3))
    pulses[::EVERY, 2] = PUFF
    runs = model.answers(flight.drive, [(wind, changes or {}, PUFF * puff) for puff in (*np.eye(3), *-np.eye(3))])
    lasting = np.stack([(runs[i] - runs[3 + i]) / (2.0 * PUFF) for i in range(3)], axis=-1)
    more, less = model.answers(flight.drive, [(wind, changes or {}, puff) for puff in (pulses, -pulses)], coarse=False)
    whole = nodes - nodes % EVERY
    pulsed = ((more - less) / (2.0 * PUFF))[:whole, :3].reshape(-1, EVERY, 3)
    begun = np.arange(0, whole, EVERY)
    first = np.column_stack([np.interp(np.arange(nodes), begun, pulsed[:, 0, axis]) for axis in range(3)])
    after = np.median(pulsed[:, 1:, 2], axis=0)
    left = float(np.clip(after[1:].sum() / after.sum() if abs(after.sum()) > 1e-9 else 0.0, *LEFT))
    # the mean over the node of what decays by `left`
    meanwhile = (1.0 - left) / -math.log(left)
    return Slopes(lasting, (first - lasting[:, :3, 2]) / meanwhile, left)


def judge(flight: Flight, wind: Floats, answer: Floats, gust: Gusts, noise: Noise) -> Driven:
    """Innovations of an answer (N, 7)."""
    nodes = len(answer)
    gains, spreads, out = np.zeros((nodes, 7, 10)), np.zeros((nodes, 7)), np.zeros((nodes, 7))
    step = flight.motion.step
    cost = innovations(
        answer, flight.measured, gust.slopes, gust.sooner, gust.follow, gust.fresh, step, gust.keep,
        gust.std * noise.gust_share, np.array(noise.process), np.array(noise.noise), gains, spreads, out,
    )  # fmt: skip
    return Driven(flight, wind, answer, gust, gains, spreads, out / spreads, float(cost))
