"""When which device samples, counted in physics ticks: no drift, no slip."""

import heapq
import math
from collections.abc import Iterable, Mapping
from typing import Any

from flightlog.errors import UserError

TICK_RATE = 500  # [Hz] physics
TICK = 1.0 / TICK_RATE  # [s]


def period_in_ticks(rate: float, name: str) -> int:
    """Ticks between two samples; UserError where the rate does not divide the physics rate."""
    period = TICK_RATE / rate
    if rate <= 0 or abs(period - round(period)) > 1e-9:
        raise UserError(f"{name}: {rate:g} Hz does not divide the rate of the physics, {TICK_RATE} Hz")
    return round(period)


class Schedule:
    """Which names are due at a tick."""

    def __init__(self, rates: Mapping[str, float]) -> None:
        periods = {name: period_in_ticks(rate, name) for name, rate in rates.items()}
        self._length = math.lcm(*periods.values()) if periods else 1
        self._due = [
            tuple(name for name, period in periods.items() if tick % period == 0) for tick in range(self._length)
        ]

    def due(self, tick: int) -> tuple[str, ...]:
        """Names that sample at this tick, in the order given."""
        return self._due[tick % self._length]


class InTransit:
    """What has been measured and has not arrived yet, handed out in order of arrival."""

    def __init__(self) -> None:
        self._heap: list[tuple[int, int, Any]] = []
        self._count = 0

    def send(self, item: Any, arrival: float) -> None:
        """`item` arrives at the first tick at or after `arrival` [s]."""
        # a tick's worth of rounding must not delay what arrives exactly on a tick
        tick = math.ceil(arrival * TICK_RATE - 1e-6)
        heapq.heappush(self._heap, (tick, self._count, item))
        self._count += 1

    def arrived(self, tick: int) -> Iterable[Any]:
        """Items that have arrived by `tick`."""
        while self._heap and self._heap[0][0] <= tick:
            yield heapq.heappop(self._heap)[2]
