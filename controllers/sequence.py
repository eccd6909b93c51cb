"""What a flight plan says to the pilot, and the plan that hovers."""

from enum import StrEnum
from typing import NamedTuple, Protocol

from flightlog.signals import StateEstimate


class Phase(StrEnum):
    """Where a flight plan stands."""

    APPROACH = "approach"  # to P1 over the pad
    HOVER = "hover"  # at P1
    CHECK = "check"  # position and speed are to stay within their limits for a while
    DESCEND = "descend"  # on fused height, inside a cone
    FLARE = "flare"  # below 2 m: collective against the ground cushion
    CUTOFF = "cutoff"  # throttle off, collective goes on holding the sink rate on the slowing rotor
    LANDED = "landed"  # contact: collective down, cyclic neutral
    GO_AROUND = "go around"  # back up, to try again
    HOLD = "hold"  # all tries spent: stays at P1


class Demand(NamedTuple):
    """What the pilot is to do now."""

    east: float  # [m] from the pad's centre
    north: float
    height: float  # [m] of the body origin, to be reached at most at `rate`
    rate: float  # [m/s]
    speed_limit: float  # [m/s] horizontal
    tilt_limit: float  # [rad] from trim
    ground_effect: bool = False  # reckon with the ground cushion
    powered: bool = True  # governor on
    flying: bool = True  # False: on the ground, controls to rest


class Sequence(Protocol):
    """A flight plan: one demand a period from the state alone."""

    phase: Phase
    finished: bool
    events: list[tuple[float, str]]  # (t [s], what happened), appended to; the runner logs them

    def update(self, state: StateEstimate) -> Demand:
        """The demand of this period."""
        ...

    def set_target(self, east: float, north: float) -> None:
        """Move the point to be flown to [m] from the pad's centre."""
        ...


class Hover:
    """Goes to a point and stays there; finished after `duration` [s] from the first update."""

    def __init__(self, *, height: float = 10.0, duration: float = float("inf"), tilt_limit: float = 0.12) -> None:
        self.phase = Phase.HOVER
        self.finished = False
        self.events: list[tuple[float, str]] = []
        self._target = (0.0, 0.0)
        self._height, self._duration, self._tilt_limit = height, duration, tilt_limit
        self._start: float | None = None

    def set_target(self, east: float, north: float) -> None:
        """Move the point to be flown to [m] from the pad's centre."""
        self._target = (east, north)

    def update(self, state: StateEstimate) -> Demand:
        """The demand of this period."""
        if self._start is None:
            self._start = state.t
            self.events.append((state.t, Phase.HOVER.value))
        self.finished = state.t - self._start >= self._duration
        return Demand(*self._target, self._height, 1.0, 1.5, self._tilt_limit)
