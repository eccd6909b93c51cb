"""The vehicle file of a multirotor: a rigid body with rotors, every number with unit, tolerance and source."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from flightlog import toml_file
from flightlog.errors import UserError
from sim.parameters import Parameter
from sim.vehicle import find
from sim.vehicle_extension import Extension
from sim.vehicle_numbers import Number, Reader, Strict

Floats = NDArray[np.float64]

LEAST_ROTORS = 3

# terms beside gravity and the rotors' thrust; by default none of them does anything
TERMS: Mapping[str, tuple[Parameter, ...]] = {
    "battery_sag": (
        Parameter("sag", "1/V", -1.0, 5.0, "share of thrust lost per volt below the reference", 0.0),
        Parameter("reference", "V", 0.1, 1000.0, "voltage under load at which the rotors' thrust is given", 3.7),
        Parameter("rest", "V", 0.0, 1000.0, "highest at rest before the flights that the numbers come from", 0.0),
    ),
    "inflow": (
        Parameter("climb", "s/m", -2.0, 2.0, "share of thrust lost per speed along the rotors' axis", 0.0),
        Parameter("ahead", "s", -0.1, 0.1, "by how far thrust moves the way it flies, per speed", 0.0),
    ),
    "motor": (
        Parameter("tau", "s", 0.0, 2.0, "lag from command to thrust", 0.0),
        Parameter("delay", "s", 0.0, 1.0, "pure delay of the commands", 0.0),
    ),
    "drag": (
        Parameter("area", "m^2", 0.0, 10.0, "equivalent flat plate", 0.0),
        Parameter("linear", "N s/m", 0.0, 100.0, "per speed, as the drag of rotors is", 0.0),
    ),
    "cg_offset": (
        Parameter("x", "m", -1.0, 1.0, "centre of mass forward of the body's origin", 0.0),
        Parameter("y", "m", -1.0, 1.0, "centre of mass left of it", 0.0),
    ),
    "payload": (
        Parameter("x", "m", -1.0, 1.0, "by how far what was added moves the centre of mass forward", 0.0),
        Parameter("y", "m", -1.0, 1.0, "the same to the left", 0.0),
    ),
    "yaw_trim": (
        Parameter("arm", "m", -1.0, 1.0, "torque to the left over thrust, of rotors that stand askew", 0.0),
        Parameter("per_volt", "m/V", -10.0, 10.0, "by how much that changes with the battery's voltage", 0.0),
    ),
    "thrust": (Parameter("scale", "1", 0.05, 20.0, "thrust of all rotors over that of the file", 1.0),),
    # by how much one flight of the same machine differs from the next: battery seated anew, wear, warmth
    "repeatability": (
        Parameter("thrust", "1", 0.0, 1.0, "thrust of all rotors", 0.0),
        Parameter("cg", "m", 0.0, 1.0, "place of the centre of mass, each axis", 0.0),
        Parameter("yaw", "m", 0.0, 1.0, "torque over thrust", 0.0),
    ),
    # the same where the battery was charged or exchanged in between: a machine that was in somebody's hands
    "handled": (
        Parameter("thrust", "1", 0.0, 1.0, "thrust of all rotors", 0.0),
        Parameter("rotor", "1", 0.0, 1.0, "thrust of each rotor by itself", 0.0),
        Parameter("cg", "m", 0.0, 1.0, "place of the centre of mass, each axis", 0.0),
    ),
}


class Thrust(Strict):
    """Thrust of one rotor from its command, or from its measured speed."""

    source: Literal["command", "speed"] = Field(alias="from")
    # rows of command 0..1 and thrust
    table: list[Annotated[list[float], Field(min_length=2, max_length=2)]] | None = Field(default=None, min_length=2)
    coefficient: float | None = Field(default=None, gt=0.0)  # thrust over speed squared [N s^2]
    unit: str = "N"
    tolerance: float = Field(default=0.0, ge=0.0)  # share


class RotorEntry(Strict):
    """One rotor, in the order of the commands m1, m2, ..."""

    position: Number
    spin: Literal["ccw", "cw"]  # seen from above
    radius: Number
    thrust: Thrust
    torque: Number | None = None  # over thrust [m]
    thrust_scale: Number | None = None  # what a diagnosis found: thrust and torque over those of a sound rotor


class Weather(Strict):
    """The weather expected where it flies."""

    wind_std: Number


class MultirotorFile(Strict):
    """The whole file, as written."""

    kind: Literal["multirotor"]
    mass: Number
    inertia: Number
    rotors: list[RotorEntry] = Field(min_length=LEAST_ROTORS)
    environment: Weather | None = None
    terms: dict[str, dict[str, Number]] = Field(default_factory=dict)
    extension: Extension | None = None


@dataclass(frozen=True)
class Value:
    """One number that may be turned, SI."""

    value: float
    unit: str
    tolerance: float  # one standard deviation of what the maker does not know; 0: known
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Multirotor:
    """A multirotor's file, checked and in SI; N rotors.

    numbers: by key, all that can be turned: `mass`, `inertia.<0..2>`, `rotors.<0..N-1>.thrust_scale`,
    `rotors.<0..N-1>.torque`, `terms.<term>.<name>`; terms that the file does not name stand there with values that do
    nothing.
    """

    name: str
    path: Path
    document: Mapping[str, Any]  # as written
    positions: Floats  # (N, 3) [m] body axes
    spins: Floats  # (N,) +1 counter-clockwise seen from above
    radii: Floats  # (N,) [m]
    by_speed: bool  # thrust from measured speed, else from the command
    tables: tuple[Floats, ...]  # (K, 2) a rotor: command, thrust [N]; empty where by speed
    coefficients: Floats  # (N,) [N s^2]; zeros where by command
    numbers: Mapping[str, Value]

    @property
    def rotors(self) -> int:
        """How many."""
        return len(self.spins)

    @property
    def mass(self) -> float:
        """[kg]."""
        return self.numbers["mass"].value

    def values(self, changes: Mapping[str, float] | None = None) -> dict[str, float]:
        """All numbers by key, with some changed; KeyError for one that is none."""
        found = {key: number.value for key, number in self.numbers.items()}
        for key, value in (changes or {}).items():
            if key not in found:
                raise KeyError(key)
            found[key] = value
        return found


def load_multirotor(name: str | Path, overrides: Mapping[str, Any] | None = None) -> Multirotor:
    """The multirotor of that name or file, with `overrides` by dotted key; UserError for any fault."""
    path = find(name)
    document = toml_file.read(path)
    for key, value in (overrides or {}).items():
        toml_file.assign(document, key, value)
    return multirotor_from(document, path)


def multirotor_from(document: Mapping[str, Any], source: Path | str) -> Multirotor:
    """The multirotor of a file's content; UserError, which names `source`, for any fault."""
    path = Path(source)
    if document.get("kind") != "multirotor":
        raise UserError(f"{path}: kind: found {document.get('kind')!r}; 'multirotor' would be right")
    file = toml_file.validate(document, MultirotorFile, path)
    reader = Reader(path)
    if len({rotor.thrust.source for rotor in file.rotors}) > 1:
        reader.fail("rotors", "thrust of some comes from the command and of others from speed; one of them for all")
    by_speed = file.rotors[0].thrust.source == "speed"
    numbers = {"mass": _value(reader, file.mass, "kg", "mass", 1e-6, 1e4)}
    reader.inertia(file.inertia, "inertia")
    for axis, value in enumerate(reader.vector(file.inertia, "kg m^2", "inertia").tolist()):
        spread = _spread(reader, file.inertia, "kg m^2", "inertia", axis)
        numbers[f"inertia.{axis}"] = Value(value, "kg m^2", spread, 0.1 * value, 10.0 * value)
    for i, rotor in enumerate(file.rotors):
        numbers |= _of_rotor(reader, rotor, i)
    return Multirotor(
        name=path.stem,
        path=path,
        document=document,
        positions=np.array([reader.vector(r.position, "m", f"rotors.{i}.position") for i, r in enumerate(file.rotors)]),
        spins=np.array([1.0 if rotor.spin == "ccw" else -1.0 for rotor in file.rotors]),
        radii=np.array(
            [reader.scalar(r.radius, "m", f"rotors.{i}.radius", positive=True) for i, r in enumerate(file.rotors)]
        ),
        by_speed=by_speed,
        tables=() if by_speed else tuple(_table(reader, rotor.thrust, i) for i, rotor in enumerate(file.rotors)),
        coefficients=np.array([_coefficient(reader, rotor.thrust, i) for i, rotor in enumerate(file.rotors)]),
        numbers={**numbers, **_of_terms(reader, file)},
    )


def _of_rotor(reader: Reader, rotor: RotorEntry, i: int) -> dict[str, Value]:
    place = f"rotors.{i}"
    torque = rotor.torque if rotor.torque is not None else Number(value=0.0, unit="m")
    scale = rotor.thrust_scale if rotor.thrust_scale is not None else Number(value=1.0, unit="1")
    found = _value(reader, scale, "1", f"{place}.thrust_scale", 0.0, 5.0)
    spread = float(np.hypot(found.tolerance, rotor.thrust.tolerance))
    return {
        f"{place}.torque": _value(reader, torque, "m", f"{place}.torque", 0.0, 10.0),
        f"{place}.thrust_scale": Value(found.value, "1", spread, found.low, found.high),
    }


def _of_terms(reader: Reader, file: MultirotorFile) -> dict[str, Value]:
    found = {}
    for name, given in file.terms.items():
        if name not in TERMS:
            reader.fail(f"terms.{name}", f"unknown term of a multirotor; {toml_file.nearest(name, list(TERMS))}")
        reader.declared(f"terms.{name}", given, TERMS[name])
    for name, parameters in TERMS.items():
        for p in parameters:
            key, number = f"terms.{name}.{p.name}", file.terms.get(name, {}).get(p.name)
            assert p.default is not None
            found[key] = (
                Value(p.default, p.unit, 0.0, p.low, p.high) if number is None
                else _value(reader, number, p.unit, key, p.low, p.high)
            )  # fmt: skip
    return found


def _value(reader: Reader, number: Number, unit: str, key: str, low: float, high: float) -> Value:
    value = reader.scalar(number, unit, key)
    if not low <= value <= high:
        reader.fail(key, f"must lie in {low:g} .. {high:g} {unit} (got {value:g})")
    return Value(value, unit, _spread(reader, number, unit, key, None), low, high)


def _spread(reader: Reader, number: Number, unit: str, key: str, axis: int | None) -> float:
    """A tolerance in SI; what an offset unit has for zero is taken off."""
    given = number.tolerance
    if isinstance(given, list):
        if axis is None or axis >= len(given):
            reader.fail(key, f"tolerance: one number for each value (got {given})")
        given = given[axis]
    zero = reader.scalar(number.model_copy(update={"value": 0.0}), unit, key)
    spread = reader.scalar(number.model_copy(update={"value": float(given)}), unit, key) - zero
    if spread < 0.0:
        reader.fail(key, f"tolerance: must not be less than 0 (got {given:g})")
    return spread


def _table(reader: Reader, thrust: Thrust, i: int) -> Floats:
    key = f"rotors.{i}.thrust"
    if thrust.table is None:
        reader.fail(key, "is from the command and needs a table of [command 0..1, thrust]")
    scale = reader.scalar(Number(value=1.0, unit=thrust.unit), "N", key)
    table = np.array(thrust.table, float) * (1.0, scale)
    if not np.all(np.isfinite(table)) or np.any(np.diff(table, axis=0) <= 0.0) or np.any(table < 0.0):
        reader.fail(f"{key}.table", "commands and thrusts must be 0 or more and rise from row to row")
    return table


def _coefficient(reader: Reader, thrust: Thrust, i: int) -> float:
    if thrust.source == "command":
        return 0.0
    if thrust.coefficient is None:
        reader.fail(f"rotors.{i}.thrust", "is from speed and needs a coefficient, thrust over speed squared [N s^2]")
    return thrust.coefficient
