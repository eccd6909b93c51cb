"""Reads the numbers of a vehicle file into SI, each fault put down to its file, line and key."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NoReturn

import numpy as np
from numpy.typing import NDArray
from pydantic import AllowInfNan, BaseModel, ConfigDict

from flightlog import toml_file
from flightlog.errors import UserError
from flightlog.units import to_si
from sim.parameters import Parameter

Floats = NDArray[np.float64]


class Strict(BaseModel):
    """No unknown keys, no numbers that are none."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Number(Strict):
    """A number of the vehicle file; a vector where its key is one."""

    value: Annotated[float, AllowInfNan(True)] | list[float]  # some numbers may be inf; whoever reads one checks it
    unit: str
    tolerance: float | list[float] = 0.0  # one standard deviation of what the maker does not know
    source: str = ""


@dataclass(frozen=True)
class Reader:
    """Turns Numbers into floats; raises UserError for all that is unfit."""

    path: Path
    settings: Collection[str] = ()  # dotted keys that came from `--set`

    def fail(self, key: str, what: str) -> NoReturn:
        """Say what is wrong with a key."""
        raise UserError(f"{toml_file.place(self.path, key, self.settings)}: {what}")

    def scalar(
        self, number: Number, unit: str, key: str, *, positive: bool = False, finite: bool = True
    ) -> float:
        """One number in `unit`."""
        if isinstance(number.value, list):
            self.fail(key, f"must be one number in {unit} (got {number.value})")
        value = self._si(number.value, number.unit, unit, key)
        if finite and not math.isfinite(value):
            self.fail(key, f"must be a finite number (got {value})")
        if positive and value <= 0.0:
            self.fail(key, f"must be more than 0 {unit} (got {value:g})")
        return value

    def vector(self, number: Number, unit: str, key: str, length: int = 3, *, positive: bool = False) -> Floats:
        """`length` numbers in `unit`."""
        if not isinstance(number.value, list) or len(number.value) != length:
            self.fail(key, f"must be {length} numbers in {unit} (got {number.value})")
        values = np.array([self._si(value, number.unit, unit, key) for value in number.value])
        if positive and np.any(values <= 0.0):
            self.fail(key, f"must all be more than 0 {unit} (got {number.value})")
        return values

    def inertia(self, number: Number, key: str) -> Floats:
        """Principal moments of inertia (3,) [kg m^2] that some body can have."""
        moments = self.vector(number, "kg m^2", key, positive=True)
        if 2.0 * moments.max() > moments.sum() * (1.0 + 1e-9):
            self.fail(key, f"no body has one moment of inertia larger than the other two together (got {number.value})")
        return moments

    def declared(self, section: str, given: Mapping[str, Number], known: Sequence[Parameter]) -> dict[str, float]:
        """The numbers that a term or a sensor declares, by name, SI, defaults filled in."""
        names = [parameter.name for parameter in known]
        for name in given:
            if name not in names:
                self.fail(f"{section}.{name}", f"unknown key; {toml_file.nearest(name, names)}")
        numbers = {}
        for parameter in known:
            key = f"{section}.{parameter.name}"
            if parameter.name in given:
                value = self.scalar(given[parameter.name], parameter.unit, key, finite=False)
            elif parameter.default is not None:
                value = parameter.default
            else:
                self.fail(key, f"is missing ({parameter.meaning}, in {parameter.unit})")
            if not parameter.low <= value <= parameter.high:
                unit = "" if parameter.unit == "1" else f" {parameter.unit}"
                self.fail(key, f"must lie in {parameter.low:g} .. {parameter.high:g}{unit} (got {value:g})")
            numbers[parameter.name] = value
        return numbers

    def _si(self, value: float, unit: str, wanted: str, key: str) -> float:
        try:
            return to_si(value, unit, wanted)
        except ValueError as error:
            self.fail(key, str(error))
