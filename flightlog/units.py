"""Units that users write, turned into the SI units in which everything is kept."""

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Values = TypeVar("Values", float, NDArray[np.float64])

# (unit as written, SI unit) -> (factor, offset): si = factor * value + offset
_UNITS = {
    ("mm", "m"): (1e-3, 0.0),
    ("cm", "m"): (1e-2, 0.0),
    ("km", "m"): (1e3, 0.0),
    ("ft", "m"): (0.3048, 0.0),
    ("g", "kg"): (1e-3, 0.0),
    ("ms", "s"): (1e-3, 0.0),
    ("min", "s"): (60.0, 0.0),
    ("us", "s"): (1e-6, 0.0),
    ("ns", "s"): (1e-9, 0.0),
    ("mm/s", "m/s"): (1e-3, 0.0),
    ("cm/s", "m/s"): (1e-2, 0.0),
    ("km/h", "m/s"): (1.0 / 3.6, 0.0),
    ("kn", "m/s"): (1852.0 / 3600.0, 0.0),
    ("cm/s^2", "m/s^2"): (1e-2, 0.0),
    ("mm/s^2", "m/s^2"): (1e-3, 0.0),
    ("g", "m/s^2"): (9.80665, 0.0),
    ("mg", "m/s^2"): (9.80665e-3, 0.0),
    ("deg", "rad"): (math.pi / 180.0, 0.0),
    ("cdeg", "rad"): (math.pi / 18000.0, 0.0),
    ("mrad", "rad"): (1e-3, 0.0),
    ("deg/s", "rad/s"): (math.pi / 180.0, 0.0),
    ("rpm", "rad/s"): (2.0 * math.pi / 60.0, 0.0),
    ("Hz", "rad/s"): (2.0 * math.pi, 0.0),
    ("hPa", "Pa"): (100.0, 0.0),
    ("mbar", "Pa"): (100.0, 0.0),
    ("kPa", "Pa"): (1e3, 0.0),
    ("degC", "K"): (1.0, 273.15),
    ("%", "1"): (1e-2, 0.0),
    ("kW", "W"): (1e3, 0.0),
    ("mV", "V"): (1e-3, 0.0),
    ("mA", "A"): (1e-3, 0.0),
    ("G", "uT"): (100.0, 0.0),
    ("mG", "uT"): (0.1, 0.0),
    ("nT", "uT"): (1e-3, 0.0),
    ("T", "uT"): (1e6, 0.0),
}


def to_si(value: Values, unit: str, wanted: str) -> Values:
    """`value` in `unit` as the SI unit `wanted`; ValueError if the unit measures something else."""
    if unit == wanted:
        return value * 1.0
    if (unit, wanted) not in _UNITS:
        fitting = [wanted, *units_of(wanted)]
        one_of = "one of " if len(fitting) > 1 else ""
        raise ValueError(f"unit {unit!r} does not fit; expected {one_of}{', '.join(fitting)}")
    factor, offset = _UNITS[unit, wanted]
    return factor * value + offset


def units_of(wanted: str) -> dict[str, float]:
    """Other units of the quantity whose SI unit is `wanted`, each with its factor to SI."""
    return {unit: factor for (unit, si), (factor, _) in _UNITS.items() if si == wanted}
