"""What a candidate cause is: parameters, and what each of them does to the model or to the measurements."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from identification.change import Change as Change
from identification.flight import Flight
from sim.vehicle import Vehicle

Where = Literal["plant", "sensor", "timing"]


@dataclass(frozen=True)
class Parameter:
    """A parameter of a cause.

    `key`: the number of the vehicle file that the extended model changes: a knob of the model for a cause of the
    plant, `sensors.<topic>.<name>` or the like for one of a sensor.
    """

    name: str
    unit: str
    key: str
    spread: float  # one standard deviation of how large it may be, where the cause is at work
    nominal: float = 0.0  # of a sensor's parameter; a knob knows its own
    tolerance: str | None = None  # vehicle file's number that says how large it is where nothing is wrong
    open_share: float = 0.0  # of what it is found to be off by, one standard deviation that more data would not close


@dataclass(frozen=True)
class Cause:
    """One entry of the catalogue.

    `changes(flight, vehicle)` gives one Change a parameter and is None where the model's own knobs do the work.
    """

    name: str
    where: Where
    parameters: tuple[Parameter, ...]
    about: str
    needs: tuple[str, ...] = ()  # topics beside those that every diagnosis needs
    changes: Callable[[Flight, Vehicle], list[Change]] | None = None
    kinds: tuple[str, ...] = ("helicopter",)  # of vehicle
    each_flight: bool = False  # parameters differ from flight to flight
    fixed: Mapping[str, float] = field(default_factory=dict)  # what tells this one of several alike: rotor, joint
    topic: str | None = None  # the device, joint or input that it is about, where there is one cause for each
    alike: int = 1  # how many of one kind there are, that share the prior of one cause: rotors, joints
    split_by: Mapping[str, str] = field(default_factory=dict)  # by confusable cause: the manoeuvre that tells
    # of causes of which a slope says little: values of the parameters, from the best of which a fit begins; those near
    # what is known about already, where that is given
    starts: Callable[[tuple[float, ...] | None], list[tuple[float, ...]]] | None = None

    @property
    def title(self) -> str:
        """The name as it is told: that of the search without the number that tells several alike apart."""
        return self.name.partition("#")[0]

    counted: bool = False  # events, with a likelihood of their own: no signature in the innovations
