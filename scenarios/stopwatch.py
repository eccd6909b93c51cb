"""Where a flight's time goes."""

import time


class Stopwatch:
    """Laps of one loop, summed by name."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.total = 0.0
        self._last = self._begin = time.perf_counter()

    def start(self) -> None:
        """From here on."""
        self._last = self._begin = time.perf_counter()

    def lap(self, name: str) -> None:
        """The time since the last lap belongs to `name`."""
        now = time.perf_counter()
        self.seconds[name] = self.seconds.get(name, 0.0) + now - self._last
        self._last = now
        self.total = now - self._begin

    def shares(self) -> dict[str, float]:
        """Shares of the total."""
        return {name: spent / self.total for name, spent in self.seconds.items()} if self.total else {}
