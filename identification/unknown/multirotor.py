"""Effects that nobody foresaw on a multirotor: forces and moments about its balance."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from identification.multirotor.bench import DRIVERS, MultirotorBench
from identification.unknown.bank import Columns, Way
from identification.unknown.drivers import NEAR, Driver

Floats = NDArray[np.float64]


class MultirotorBank:
    """See `bank.Bank`."""

    def __init__(self, bench: MultirotorBench) -> None:
        """Of flights that are prepared."""
        self._bench = bench
        seen = [{s.channel for s in flight.seen} for flight in bench.flights]
        about = [bench.channels[number] for number in sorted(set.intersection(*seen))]
        self.ways: Mapping[str, Way] = {c.name: Way(c.name, c.unit, c.name[:-2], c.name) for c in about}

    def drivers(self, flight: int) -> Mapping[str, Driver]:
        """See `bank.Bank.drivers`."""
        courses = self._bench.drivers(flight)
        return {
            name: Driver(DRIVERS[name], np.asarray(values, float), NEAR if name == "height" else None)
            for name, (_, _, values) in courses.items()
        }

    def columns(self, flight: int, way: str, shapes: Floats) -> Columns:
        """See `bank.Bank.columns`."""
        item = self._bench.flights[flight]
        channels = [self._bench.channels[s.channel].name for s in item.seen]
        which, nodes = channels.index(way), len(item.t)
        kernel = item.seen[which].kernel
        parts = []
        for first, last in item.spans:
            padded = np.pad(shapes[first:last], ((len(kernel) // 2,) * 2, (0, 0)), mode="edge")
            parts.append(np.stack([np.convolve(column, kernel, "valid") for column in padded.T], axis=1))
        return Columns(
            slice(which * nodes, (which + 1) * nodes), self._bench.white(flight, which, np.concatenate(parts))
        )
