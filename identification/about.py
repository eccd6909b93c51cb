"""A vehicle whose sensors have errors that a search found, so that flights can be prepared about them.

What a sensor's error does to the filtered motion is taken to first order. A mark 65 ms late in quick turns, or a lens
far from its model, is beyond that: what is left over then looks like other causes.
"""

import tomllib
from collections.abc import Mapping

import numpy as np

from flightlog.units import to_si
from identification.extension import Delta, extended
from sim.vehicle import Vehicle, from_document

OF_SENSORS = ("sensors.", "cameras.")


def with_errors(vehicle: Vehicle, values: Mapping[str, float], units: Mapping[str, str]) -> Vehicle:
    """The vehicle with these numbers, absolute by key, SI; in memory only."""
    nothing = np.zeros((len(values), len(values)))
    text = extended(vehicle, Delta(values, dict.fromkeys(values, "found"), units, nothing, {}), {})
    return from_document(tomllib.loads(text), vehicle.path)


def number(vehicle: Vehicle, key: str, unit: str, silent: float) -> float:
    """A number of the file in `unit`; `silent` where the file does not have it."""
    entry: object = vehicle.document
    for part in key.split("."):
        entry = entry.get(part) if isinstance(entry, Mapping) else None
    return to_si(float(entry["value"]), entry["unit"], unit) if isinstance(entry, Mapping) else silent
