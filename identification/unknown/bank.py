"""What a bench must offer so that an unknown effect can be sought on it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from identification.unknown.drivers import Driver

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Way:
    """One way in which an effect may come in: a force, a moment, a sensor's error."""

    name: str
    unit: str
    group: str  # of those that share a threshold
    shows: str  # channel of the bench in which it shows first


@dataclass(frozen=True, eq=False)
class Columns:
    """Signatures (R', C) in some of a flight's rows; in all others there is nothing."""

    rows: slice
    values: Floats


class Bank(Protocol):
    """Signatures of effects that nobody foresaw."""

    ways: Mapping[str, Way]

    def drivers(self, flight: int) -> Mapping[str, Driver]:
        """What they may depend on, along one flight."""
        ...

    def columns(self, flight: int, way: str, shapes: Floats) -> Columns:
        """What is seen, whitened as `Bench.rows`, of effects that run as `shapes` (N, C) along the flight's nodes."""
        ...
