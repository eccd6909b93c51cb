"""Units that users write, turned into the SI units that the model declares."""

import math

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


def to_si(value: float, unit: str, wanted: str) -> float:
    """`value` in `unit` as the SI unit `wanted`; ValueError if the unit measures something else."""
    if unit == wanted:
        return float(value)
    si, factor, offset = _UNITS.get(unit, (None, 1.0, 0.0))
    if si != wanted:
        fitting = [wanted, *(name for name, (target, _, _) in _UNITS.items() if target == wanted)]
        one_of = "one of " if len(fitting) > 1 else ""
        raise ValueError(f"unit {unit!r} does not fit; expected {one_of}{', '.join(fitting)}")
    return factor * value + offset
