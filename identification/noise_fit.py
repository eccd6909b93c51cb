"""Noise and gusts of the model's channels by maximum likelihood, after everything that has a name was taken out.

Sensors' noise and what the model leaves open are the same on all flights; each flight has gusts of its own.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from identification.drive import Noise, judge
from identification.flight import Flight
from identification.gusts import Gusts

Floats = NDArray[np.float64]

MOST = 10.0  # that a channel's levels are raised by
MAD = 0.6745  # median of the absolute value of a standard normal number
GUST_WIDTH = 1.0  # of the logarithm of a flight's gusts about what is usual, one standard deviation


@dataclass(frozen=True, eq=False)
class Settled:
    """A flight with what is named taken out of it; answer (N, 7)."""

    flight: Flight
    wind: Floats
    answer: Floats
    gust: Gusts


def fit(least: Sequence[Noise], flights: Sequence[Settled], like: Noise | None = None) -> list[Noise]:
    """By flight, the gusts under which its innovations are likeliest; channels' levels are raised, never lowered.

    least: levels that a sound model needs anyway; like: all but the gusts are known.
    """
    start = _scaled(least, flights) if like is None else [replace(like, gust_share=n.gust_share) for n in least]

    def gusty(noise: Noise, x: Floats) -> Noise:
        across, up = np.exp(x).tolist()
        return replace(noise, gust_share=(across, across, up))

    def fitted(noise: Noise, f: Settled) -> Noise:
        def cost(x: Floats) -> float:
            calm = x / GUST_WIDTH
            return 0.5 * judge(f.flight, f.wind, f.answer, f.gust, gusty(noise, x)).cost + 0.5 * float(calm @ calm)

        first = np.vstack([np.zeros(2), GUST_WIDTH * np.eye(2)])
        options = {"initial_simplex": first, "xatol": 0.05, "fatol": 0.5, "maxfev": 40}
        solved = minimize(cost, np.zeros(2), method="Nelder-Mead", options=options)
        return gusty(noise, np.asarray(solved.x))

    with ThreadPoolExecutor() as pool:
        return list(pool.map(fitted, start, flights))


def _scaled(start: Sequence[Noise], flights: Sequence[Settled]) -> list[Noise]:
    """Each channel's levels times the spread of its innovations over all flights."""
    left = np.concatenate(
        [judge(f.flight, f.wind, f.answer, f.gust, noise).residual for f, noise in zip(flights, start, strict=True)]
    )
    left = np.where(left == 0.0, np.nan, left)
    factor = np.clip(np.nan_to_num(np.nanmedian(np.abs(left), axis=0) / MAD, nan=1.0), 1.0, MOST)
    return [
        replace(
            noise, noise=tuple((np.array(noise.noise) * factor).tolist()),
            process=tuple((np.array(noise.process) * factor).tolist()),
        )
        for noise in start
    ]  # fmt: skip
