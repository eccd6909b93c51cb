"""A vehicle as it may really be: every number of its file drawn within its tolerance."""

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flightlog.errors import UserError
from sim import sensors, terms
from sim import vehicle as vehicles
from sim.multirotor import Multirotor
from sim.rig import Rig
from sim.vehicle import Vehicle

if TYPE_CHECKING:
    from tests.blind.effects import Effect

FURTHEST = 3.0  # standard deviations
SMALLEST = 0.1  # of a positive number that stays positive
TRIES = 50


def drawn(document: Mapping[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """A copy of a vehicle file's content, each number that has a tolerance drawn anew."""
    found = copy.deepcopy(dict(document))
    for key, number in _numbers(found):
        value, tolerance = np.asarray(number["value"], float), np.asarray(number.get("tolerance", 0.0), float)
        normal = rng.standard_normal(value.shape)
        while np.any(np.abs(normal) > FURTHEST):
            normal = rng.standard_normal(value.shape)
        moved = value + tolerance * normal
        if value.ndim == 0 and value > 0.0:
            moved = np.maximum(moved, SMALLEST * value)
        low, high = _range(key, str(number["unit"]))
        number["value"] = np.clip(moved, low, high).tolist()
    return found


def vehicle(of: Vehicle, rng: np.random.Generator) -> Vehicle:
    """A vehicle drawn from a file; drawn again where the numbers together make none."""
    for _ in range(TRIES):
        try:
            return vehicles.from_document(drawn(of.document, rng), of.path)
        except UserError:
            continue
    raise RuntimeError(f"{of.path}: no vehicle in {TRIES} draws")


def numbers(of: Multirotor | Rig, rng: np.random.Generator) -> dict[str, float]:
    """All numbers of a multirotor or rig by key, each that has a tolerance drawn anew."""
    found = {}
    for key, number in of.numbers.items():
        normal = rng.standard_normal()
        while abs(normal) > FURTHEST:
            normal = rng.standard_normal()
        moved = number.value + number.tolerance * normal
        if number.value > 0.0:
            moved = max(moved, SMALLEST * number.value)
        found[key] = float(np.clip(moved, number.low, number.high))
    return found


def injected(true: Vehicle, effects: "Sequence[Effect]") -> Vehicle:
    """The vehicle with these effects in it."""
    document = copy.deepcopy(dict(true.document))
    for effect in effects:
        for key, (value, unit) in effect.settings.items():
            _assign(document, key, value, unit)
    vehicle = vehicles.from_document(document, true.path)
    extra = [item for effect in effects for item in effect.terms]
    return replace(
        vehicle,
        terms=(*vehicle.terms, *(term for term, _ in extra)),
        parameters={**vehicle.parameters, **{term.name: dict(numbers) for term, numbers in extra}},
    )


def _assign(document: dict[str, Any], dotted: str, value: float, unit: str) -> None:
    """Set a number of a vehicle file; `a.b.1` an element of a vector."""
    *way, last = dotted.split(".")
    if last.isdecimal():
        *way, last_name = way
        entry = _table(document, way)[last_name]
        entry["value"] = [value if i == int(last) else v for i, v in enumerate(entry["value"])]
        entry["unit"] = unit
        return
    table = _table(document, way)
    table[last] = {**table.get(last, {}), "value": value, "unit": unit}
    table[last].pop("tolerance", None)


def _table(document: dict[str, Any], way: Sequence[str]) -> dict[str, Any]:
    for part in way:
        document = document.setdefault(part, {})
    return document


def _numbers(document: Mapping[str, Any], at: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    for name, entry in document.items():
        key = f"{at}.{name}" if at else name
        if isinstance(entry, dict) and "value" in entry:
            if np.any(np.asarray(entry.get("tolerance", 0.0), float) > 0.0):
                yield key, entry
        elif isinstance(entry, dict):
            yield from _numbers(entry, key)


def _range(key: str, unit: str) -> tuple[float, float]:
    """Where a term's or sensor's number makes sense, as far as its own unit says it."""
    section, *rest = key.split(".")
    catalogue: Any = {"terms": terms.CATALOGUE, "sensors": sensors.CATALOGUE}.get(section)
    if catalogue is None or len(rest) != 2 or rest[0] not in catalogue:
        return -np.inf, np.inf
    owner = catalogue[rest[0]]
    declared = owner.parameters if section == "terms" else owner.PARAMETERS
    for parameter in declared:
        if parameter.name == rest[1] and parameter.unit == unit:
            return parameter.low, parameter.high
    return -np.inf, np.inf
