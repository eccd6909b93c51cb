"""A vehicle as it may really be: every number of its file drawn within its tolerance."""

import copy
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from flightlog.errors import UserError
from sim import sensors, terms
from sim import vehicle as vehicles
from sim.vehicle import Vehicle

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
