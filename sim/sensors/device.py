"""What all simulated devices share: their numbers, mount, site and random numbers."""

import math
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from sim.parameters import Parameter
from sim.sensors.contract import Floats, Site

RATE = Parameter("rate", "Hz", 1.0, 500.0, "samples a second; divides 500")
LATENCY = Parameter("latency", "s", 0.0, 2.0, "from the time of validity to the arrival", 0.0)
CLOCK = Parameter("clock", "s", -1.0, 5.0, "by which the device's clock is ahead: its stamps are late", 0.0)


class Numbers(dict[str, float]):
    """Values by name that remember having been changed, so that a device recomputes what follows from them."""

    changed = True

    def __setitem__(self, name: str, value: float) -> None:
        """Change a number in force; KeyError for a name that the device does not have."""
        if name not in self:
            raise KeyError(f"no such number: {name}; there are {', '.join(self)}")
        super().__setitem__(name, float(value))
        self.changed = True

    def update(self, *args: Any, **kwargs: float) -> None:
        """Change several numbers."""
        for name, value in dict(*args, **kwargs).items():
            self[name] = value


def complete(parameters: Iterable[Parameter], numbers: Mapping[str, float], topic: str) -> Numbers:
    """`numbers` with the defaults of `parameters` filled in; KeyError for one that is missing or unknown."""
    declared = {parameter.name: parameter.default for parameter in parameters}
    unknown = [name for name in numbers if name not in declared]
    values = {**declared, **numbers}
    missing = [name for name, value in values.items() if value is None]
    if unknown or missing:
        raise KeyError(f"sensors.{topic}: missing {missing}, unknown {unknown}")
    return Numbers({name: float(value) for name, value in values.items() if value is not None})


class Device:
    """A base for sensors: keeps what the constructor is given, and the time between two samples."""

    topic: ClassVar[str]
    PARAMETERS: ClassVar[tuple[Parameter, ...]]
    ERRORS: ClassVar[tuple[tuple[str, str], ...]]

    def __init__(self, numbers: Mapping[str, float], position: Floats, site: Site, rng: np.random.Generator) -> None:
        """`numbers` SI by name of PARAMETERS; `position` (3,) [m] of the mount in body axes."""
        self.numbers: dict[str, float] = complete(self.PARAMETERS, numbers, self.topic)
        x, y, z = np.asarray(position, float).tolist()
        self.position = (x, y, z)
        self.site = site
        self.rng = rng
        self._period = 1.0 / self.numbers["rate"]  # [s]
        self._last = math.nan  # [s] time of the last sample

    def elapsed(self, t: float) -> float:
        """Time [s] since the last sample, which may be long where the device was silenced; a period at the first."""
        dt = t - self._last
        self._last = t
        return dt if dt > 0.0 else self._period

    def height_of_mount(self, rotation: Floats) -> float:
        """Height [m] of the mount above the body origin in the world; `rotation` (3, 3) body to world."""
        a, b, c = rotation[2].tolist()
        x, y, z = self.position
        return float(a * x + b * y + c * z)
