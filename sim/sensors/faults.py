"""Faults that can be laid on any sensor from outside: they change, repeat or drop what it sends.

A fault is anything with a `topic` and `apply`; a user's own needs no entry here. Changing a number of the sensor
itself (`World.set_numbers`) is the other way to break one.
"""

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from flightlog.signals import Measurement


class Fault(Protocol):
    """Called once for every sample of its topic, in order of time."""

    topic: str

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """What is sent in place of `sample` at time t [s]; None: nothing."""
        ...


@dataclass(kw_only=True)
class _Span:
    """A fault that acts on `topic` from `start` to `end` [s]."""

    topic: str
    start: float = 0.0
    end: float = math.inf

    def acts(self, t: float) -> bool:
        """Whether the fault is on at time t."""
        return self.start <= t < self.end


def _with(sample: Any, column: str, value: float) -> Measurement:
    """`sample` with a number changed; dropouts (NaN) stay what they are."""
    changed: Measurement = sample._replace(**{column: value})
    return changed


def stamped(sample: Any, late: float) -> Measurement:
    """`sample` with its times moved by `late` [s]."""
    moved: Any = _with(sample, "t", sample.t + late)
    return _with(moved, "t_arrival", moved.t_arrival + late) if hasattr(moved, "t_arrival") else moved


@dataclass(kw_only=True)
class Stuck(_Span):
    """A column keeps the value that it had when the fault began."""

    column: str
    _held: float | None = field(default=None, init=False, repr=False)

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """`sample` with the column's held value."""
        del rng
        if not self.acts(t):
            self._held = None
            return sample
        if self._held is None:
            self._held = getattr(sample, self.column)
        return _with(sample, self.column, self._held)


@dataclass(kw_only=True)
class Offset(_Span):
    """A column is off by `size`, in its own unit."""

    column: str
    size: float

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """`sample` with the offset added."""
        del rng
        return _with(sample, self.column, getattr(sample, self.column) + self.size) if self.acts(t) else sample


@dataclass(kw_only=True)
class Ramp(_Span):
    """A column drifts away by `size` a second from the fault's beginning on, and is right again at its end."""

    column: str
    size: float

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """`sample` with the drift so far added."""
        del rng
        if not self.acts(t):
            return sample
        return _with(sample, self.column, getattr(sample, self.column) + self.size * (t - self.start))


@dataclass(kw_only=True)
class Spike(_Span):
    """A `share` of the samples is off by up to `size` either way, uniformly."""

    column: str
    size: float
    share: float = 0.05

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """`sample`, now and then with an outlier."""
        hit, where = rng.random(2).tolist()
        if not self.acts(t) or hit >= self.share:
            return sample
        return _with(sample, self.column, getattr(sample, self.column) + self.size * (2.0 * where - 1.0))


@dataclass(kw_only=True)
class Dropout(_Span):
    """A `share` of the samples never arrives; by default all."""

    share: float = 1.0

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """`sample` or nothing."""
        hit = rng.random()
        return None if self.acts(t) and hit < self.share else sample


@dataclass(kw_only=True)
class ClockOffset(_Span):
    """The device's clock is ahead by `delay` [s]: samples carry a time later than the truth that they hold."""

    delay: float

    def apply(self, sample: Measurement, t: float, rng: np.random.Generator) -> Measurement | None:
        """`sample` with its time stamps moved."""
        del rng
        return stamped(sample, self.delay) if self.acts(t) else sample


COLUMN_FAULTS: dict[str, type[Stuck] | type[Offset] | type[Ramp] | type[Spike]] = {
    "stuck": Stuck,
    "offset": Offset,
    "ramp": Ramp,
    "spike": Spike,
}


def column_fault(
    kind: str, topic: str, column: str, *, start: float, end: float, size: float = 0.0, share: float = 0.05
) -> Fault:
    """The fault of a kind of COLUMN_FAULTS on one column, from `start` to `end` [s]."""
    numbers = {"topic": topic, "column": column, "start": start, "end": end, "size": size, "share": share}
    wanted = {item.name for item in dataclasses.fields(COLUMN_FAULTS[kind]) if item.init}
    return COLUMN_FAULTS[kind](**{name: value for name, value in numbers.items() if name in wanted})  # type: ignore[arg-type]
