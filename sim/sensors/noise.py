"""Random numbers and coloured noise that the sensors share."""

import math

import numpy as np


def gauss_markov(value: float, std: float, tau: float, dt: float, normal: float) -> float:
    """The next value, dt [s] later, of a first-order Gauss-Markov process.

    Deviation `std`, time constant `tau` [s], `normal` a standard normal number. Exact for any dt:
    x' = E x + std sqrt(1 - E^2) n with E = exp(-dt/tau).
    """
    decay = math.exp(-dt / tau)
    return decay * value + std * math.sqrt(1.0 - decay * decay) * normal


class Normals:
    """Rows of standard normal numbers, drawn in blocks because one large draw is far cheaper than many small ones."""

    def __init__(self, rng: np.random.Generator, width: int, rows: int = 256) -> None:
        """Rows of `width` numbers, `rows` of them at a time."""
        self._rng = rng
        self._shape = (rows, width)
        self._block: list[list[float]] = []

    def draw(self) -> list[float]:
        """The next row."""
        if not self._block:
            self._block = self._rng.standard_normal(self._shape).tolist()
        return self._block.pop()
