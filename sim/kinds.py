"""Vehicle files of every kind."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flightlog import toml_file
from flightlog.errors import UserError
from sim import vehicle
from sim.multirotor.file import Multirotor, load_multirotor
from sim.rig import Rig, load_rig

KINDS = ("helicopter", "multirotor", "rig")

AnyVehicle = vehicle.Vehicle | Multirotor | Rig


def load(name: str | Path, overrides: Mapping[str, Any] | None = None) -> AnyVehicle:
    """The vehicle of that name or file, whatever its kind; UserError for any fault."""
    path = vehicle.find(name)
    kind = toml_file.read(path).get("kind")
    if kind not in KINDS:
        raise UserError(f"{path}: kind: found {kind!r}; one of {', '.join(KINDS)} would be right")
    if kind == "multirotor":
        return load_multirotor(name, overrides)
    return load_rig(name, overrides) if kind == "rig" else vehicle.load(name, overrides)
