"""Units that users write, turned into the SI units that the model declares."""

import math

from flightlog.errors import UserError

# unit as written -> (SI unit, factor, offset): si = factor * value + offset
_UNITS = {
    "mm": ("m", 1e-3, 0.0),
    "cm": ("m", 1e-2, 0.0),
    "g": ("kg", 1e-3, 0.0),
    "ms": ("s", 1e-3, 0.0),
    "min": ("s", 60.0, 0.0),
    "deg": ("rad", math.pi / 180.0, 0.0),
    "deg/s": ("rad/s", math.pi / 180.0, 0.0),
    "rpm": ("rad/s", 2.0 * math.pi / 60.0, 0.0),
    "hPa": ("Pa", 100.0, 0.0),
    "degC": ("K", 1.0, 273.15),
    "%": ("1", 1e-2, 0.0),
    "kW": ("W", 1e3, 0.0),
}


def to_si(value: float, unit: str, wanted: str, where: str) -> float:
    """`value` in `unit` as the SI unit `wanted`; UserError, beginning with `where`, if the unit measures something else."""
    if unit == wanted:
        return float(value)
    si, factor, offset = _UNITS.get(unit, (None, 1.0, 0.0))
    if si != wanted:
        fitting = [wanted, *(name for name, (target, _, _) in _UNITS.items() if target == wanted)]
        raise UserError(f"{where}: unit {unit!r} does not fit; expected one of {', '.join(fitting)}")
    return factor * value + offset
