"""Noise and gusts of the model's channels by maximum likelihood, after everything that has a name was taken out."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from identification.drive import Noise, judge
from identification.flight import Flight

Floats = NDArray[np.float64]

GUST, FORCE, RATE, ROTOR = slice(0, 2), slice(2, 5), slice(5, 8), slice(8, 10)
ITERATIONS = 6
STEP = 0.02  # of a logarithm, for the gradient
MAD = 0.6745  # median of the absolute value of a standard normal number
REACH = np.log(30.0)  # that a level may move


@dataclass(frozen=True, eq=False)
class Settled:
    """A flight with what is named taken out of it: gust (N, 7, 3) slopes, answer (N, 7)."""

    flight: Flight
    wind: Floats
    answer: Floats
    gust: Floats


def levels(noise: Noise) -> Floats:
    """(13,) logarithms: gusts across and up, noise of force, process and noise of the rates and of the rotor."""
    return np.log([noise.gust_std[0], noise.gust_std[2], *noise.noise[:3], *noise.process[3:], *noise.noise[3:]])


def of_levels(x: Floats, like: Noise) -> Noise:
    """The inverse of `levels`."""
    v = np.exp(x).tolist()
    return replace(
        like, gust_std=(v[0], v[0], v[1]), process=(0.0, 0.0, 0.0, *v[5:9]), noise=(*v[2:5], *v[9:13])
    )  # fmt: skip


def fit(start: Noise, flights: Sequence[Settled]) -> Noise:
    """The levels under which the innovations of all flights are likeliest."""
    start = _scaled(start, flights)
    first = levels(start)

    def cost(x: Floats) -> float:
        noise = of_levels(x, start)
        return 0.5 * sum(judge(f.flight, f.wind, f.answer, f.gust, noise).cost for f in flights)

    with ThreadPoolExecutor() as pool:
        solved = minimize(
            _with_slope(cost, pool.map), first, jac=True, method="L-BFGS-B",
            bounds=[(x - REACH, x + REACH) for x in first], options={"maxiter": ITERATIONS, "ftol": 1e-6},
        )  # fmt: skip
    return of_levels(np.asarray(solved.x), start)


def _scaled(noise: Noise, flights: Sequence[Settled]) -> Noise:
    """Each channel's levels times the spread of its innovations."""
    left = np.concatenate([judge(f.flight, f.wind, f.answer, f.gust, noise).residual for f in flights])
    left = np.where(left == 0.0, np.nan, left)
    spread = np.nan_to_num(np.nanmedian(np.abs(left), axis=0) / MAD, nan=1.0)
    factor = np.clip(spread, 0.1, 10.0)
    return replace(
        noise, noise=tuple((np.array(noise.noise) * factor).tolist()),
        process=tuple((np.array(noise.process) * factor).tolist()),
    )  # fmt: skip


def _with_slope(
    cost: Callable[[Floats], float], spread: Callable[..., object]
) -> Callable[[Floats], tuple[float, Floats]]:
    def both(x: Floats) -> tuple[float, Floats]:
        points = [x, *(x + STEP * unit for unit in np.eye(len(x)))]
        values = np.array(list(spread(cost, points)))  # type: ignore[call-overload]
        return float(values[0]), (values[1:] - values[0]) / STEP

    return both
