"""An unknown effect as a term of the extended vehicle: a table within what was visited."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from identification.unknown.finding import Found
from sim.kinds import AnyVehicle
from sim.terms.table import ACTS, DRIVERS, POINTS, TABLES
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Tables:
    """Numbers of a vehicle file, SI, by key."""

    values: Mapping[str, float]
    units: Mapping[str, str]
    of: Mapping[str, str]  # what is told as the origin
    covariance: Floats


def tables(effects: Sequence[Found], vehicle: AnyVehicle) -> Tables:
    """Effects on a helicopter that act as a force or a moment and for whose driver there is a table; each once."""
    values: dict[str, float] = {}
    units: dict[str, str] = {}
    of: dict[str, str] = {}
    blocks: list[Floats] = []
    for effect in effects if isinstance(vehicle, Vehicle) else ():
        assert isinstance(vehicle, Vehicle)
        acts, driver = effect.way.name, effect.driver
        if acts not in ACTS or driver not in DRIVERS or f"terms.table_{acts}_{driver}.at_0" in values:
            continue
        name = f"table_{acts}_{driver}"
        scale = float(vehicle.geometry["mass"]) if acts.startswith("force") else vehicle.inertia["xyz".index(acts[-1])]
        to = _picking(effect.x)
        at, value = to @ effect.x, scale * (to @ effect.values)
        if name in vehicle.parameters:  # what was found comes on top of it
            there = vehicle.parameters[name]
            places, old = ([there[f"{key}_{i}"] for i in range(POINTS)] for key in ("at", "value"))
            value = value + np.interp(at, places, old)
        about = "" if effect.form is None else f", about {effect.form.text} [{effect.way.unit}]"
        for i, parameter in enumerate(TABLES[name].parameters):
            key = f"terms.{name}.{parameter.name}"
            values[key] = float(at[i] if i < POINTS else value[i - POINTS])
            units[key] = parameter.unit
            of[key] = f"{acts} over {driver}{about}"
        blocks += [np.zeros((POINTS, POINTS)), scale**2 * to @ effect.covariance @ to.T]
    return Tables(values, units, of, block_diag(*blocks) if blocks else np.zeros((0, 0)))


def _picking(x: Floats) -> Floats:
    """(POINTS, P) that picks POINTS of a curve's points, both ends among them."""
    return np.asarray(np.eye(len(x))[np.linspace(0, len(x) - 1, POINTS).round().astype(int)])
