"""Scenario files: found by name or path, overridden by dotted keys, checked."""

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flightlog import toml_file
from flightlog.errors import UserError
from scenarios.schema import Scenario

_HERE = Path(__file__).parent
_VEHICLE = "vehicle."


def available() -> list[str]:
    """Names of the scenarios that come with the project."""
    return sorted(path.stem for path in _HERE.glob("*.toml"))


def find(name: str | Path) -> Path:
    """The file of a scenario's name, or a user's own file; UserError where there is none."""
    path = Path(name)
    if path.suffix == ".toml":
        return path
    own = _HERE / f"{name}.toml"
    if not own.is_file():
        raise UserError(f"unknown scenario {str(name)!r}; {toml_file.nearest(str(name), available())}")
    return own


def load(name: str | Path, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """The scenario of that name or file with `overrides` by dotted key (`weather.wind_m_s`); UserError for any fault.

    Keys that begin with `vehicle.` are the vehicle file's: see `split_overrides`.
    """
    path = find(name)
    document = copy.deepcopy(toml_file.read(path))
    for key, value in (overrides or {}).items():
        toml_file.assign(document, key, value)
    return toml_file.validate(document, Scenario, path)


def build(**tables: Any) -> Scenario:
    """A scenario made in Python: the keys of the file as keyword arguments."""
    return toml_file.validate({"vehicle": "raptor90", **tables}, Scenario, "scenario")


def split_overrides(settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """`--set` keys parted into those of the scenario and those of the vehicle file (`vehicle.terms.X.y`)."""
    scenario = {key: value for key, value in settings.items() if not key.startswith(_VEHICLE)}
    vehicle = {key.removeprefix(_VEHICLE): value for key, value in settings.items() if key.startswith(_VEHICLE)}
    return scenario, vehicle
