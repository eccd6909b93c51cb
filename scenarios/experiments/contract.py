"""What a published experiment is, and what it answers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

Effort = Literal["full", "quick"]


@dataclass(frozen=True)
class Job:
    """A share of an experiment that runs in a process of its own.

    `work(*arguments)` is a module's function; arguments and answer can be pickled. All its randomness comes from
    seeds among the arguments.
    """

    work: Callable[..., Any]
    arguments: tuple[Any, ...]
    label: str  # for the progress bar
    cost: float = 1.0  # seconds on one core, roughly


@dataclass(frozen=True)
class Figure:
    """One quantity: what the paper says, what a faithful build gives, what ours gives. None: no such figure."""

    quantity: str
    unit: str
    published: float | None  # as the paper prints it
    faithful: float | None  # measured here, variant "published"
    ours: float | None  # measured here, variant "helideck"
    bar: float | None = None  # what ours must reach
    at_most: bool = True  # the bar bounds from above
    bound: float | None = None  # what physics allows (Cramer-Rao), with these sensors
    expected: tuple[float, float] | None = None  # where a faithful build must land; None: within 20 % of `published`
    note: str = ""

    @property
    def reached(self) -> bool | None:
        """Whether ours reaches the bar; None without one."""
        if self.bar is None or self.ours is None:
            return None
        return self.ours <= self.bar if self.at_most else self.ours >= self.bar

    @property
    def reproduced(self) -> bool | None:
        """Whether the faithful build lands where the paper does; None where either has no figure."""
        if self.faithful is None:
            return None
        if self.expected is not None:
            return self.expected[0] <= self.faithful <= self.expected[1]
        return None if self.published is None else abs(self.faithful - self.published) <= 0.2 * abs(self.published)


@dataclass(frozen=True, eq=False)
class Series:
    """One line of a plot."""

    label: str
    x: Floats  # (N,)
    y: Floats  # (N,)
    style: Literal["line", "points", "steps"] = "line"


@dataclass(frozen=True, eq=False)
class Plot:
    """Curves to be drawn: what a reader should see is said in the caption."""

    title: str
    caption: str
    x_label: str  # with its unit
    y_label: str
    series: Sequence[Series]
    bands: Sequence[tuple[str, float, float]] = ()  # label, low, high: horizontal
    log_y: bool = False


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture, such as a frame with what was found in it; (H, W) or (H, W, 3) RGB, uint8."""

    title: str
    caption: str
    image: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What an experiment has shown."""

    figures: Sequence[Figure]
    plots: Sequence[Plot] = ()
    pictures: Sequence[Picture] = ()
    notes: Sequence[str] = ()  # sentences: what the sensors' noise was, what falls short and why
    tables: Sequence[tuple[str, Sequence[dict[str, Any]]]] = field(default=())  # title and rows of plain numbers


class Experiment(Protocol):
    """One published experiment: a module of this package with these names."""

    NAME: str  # "desk"
    SYSTEM: str  # "lei2012", "wu2019", "zeng", "huang"; "all" for what concerns every system
    TITLE: str  # one line
    ABOUT: str  # a paragraph: what the paper did, what is done here

    def jobs(self, effort: Effort) -> Sequence[Job]:
        """The work, in shares that may run in any order and process."""
        ...

    def conclude(self, effort: Effort, answers: Sequence[Any]) -> Outcome:
        """From the jobs' answers, in the order of `jobs(effort)`, to figures."""
        ...
