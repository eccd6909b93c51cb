"""What an unknown barometer and an unknown ranger must show before a filter hears them.

Aboard a vehicle whose sensors are known, the filter's gates do this. In a log of unknown make with no inertial samples
the filter itself is too unsure to gate by: a barometer that climbs away in four samples, or echoes that follow each
other at random, would each time be within what it holds possible.
"""

from collections import deque

from flightlog.signals import BaroSample

FASTEST = 20.0  # [m/s] no vehicle climbs or falls faster
LOUD = 6.0  # standard deviations of noise


class BaroScreen:
    """Lets a sample through when it has stood for HOLD without a jump next to it.

    A jump speaks against what came just before it as well as against what follows.
    """

    HOLD = 0.5  # [s]

    def __init__(self, noise: float) -> None:
        """`noise` [m]: standard deviation of one sample."""
        self._noise = noise
        self._held: deque[BaroSample] = deque()
        self._last: BaroSample | None = None
        self._until = -float("inf")
        self.rejected = 0

    def pass_on(self, s: BaroSample) -> list[BaroSample]:
        """Take a sample with a finite altitude; what has now stood for long enough."""
        last, self._last = self._last, s
        if last is not None and 0.0 < s.t - last.t < 1.0 and self._jumped(last, s):
            self.rejected += len(self._held)
            self._held.clear()
            self._until = s.t + self.HOLD
        if s.t < self._until:
            self.rejected += 1
        else:
            self._held.append(s)
        out = []
        while self._held and self._held[0].t <= s.t - self.HOLD:
            out.append(self._held.popleft())
        return out

    def _jumped(self, last: BaroSample, s: BaroSample) -> bool:
        return abs(s.altitude - last.altitude) > FASTEST * (s.t - last.t) + LOUD * self._noise


class SonarScreen:
    """Lets an echo through while ranger and barometer have moved together for the last second."""

    SPAN = 1.0  # [s]
    LEAST = 4  # echoes
    TOGETHER = 1.0  # [m]

    def __init__(self, noise: float) -> None:
        """`noise` [m]: standard deviation of one sample of the barometer."""
        self._spread = max(self.TOGETHER, LOUD * noise)
        self._apart: deque[tuple[float, float]] = deque()
        self._altitude: float | None = None

    def baro(self, altitude: float) -> None:
        """The barometer's latest height [m]."""
        self._altitude = altitude

    def passes(self, t: float, height: float) -> bool:
        """Whether an echo that means `height` [m] may be heard; always where there is no barometer."""
        if self._altitude is None:
            return True
        apart = self._apart
        apart.append((t, height - self._altitude))
        while apart[0][0] < t - self.SPAN:
            apart.popleft()
        differences = [difference for _, difference in apart]
        return len(apart) >= self.LEAST and max(differences) - min(differences) < self._spread
