"""Scenario files: found by name or path, overridden by dotted keys, checked."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flightlog import toml_file
from flightlog.errors import UserError
from scenarios.schema import Scenario

_HERE = Path(__file__).parent


def available() -> list[str]:
    """Names of the scenarios that come with the project."""
    return sorted(path.stem for path in _HERE.glob("*.toml"))


def find(name: str | Path) -> Path:
    """The file of a scenario's name, or a user's own file; UserError where there is none."""
    path = Path(name)
    if path.suffix == ".toml":
        return path
    if str(name) not in available():
        raise UserError(f"unknown scenario {str(name)!r}; {toml_file.nearest(str(name), available())}")
    return _HERE / f"{name}.toml"


def load(name: str | Path, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """The scenario of that name or file with `overrides` by dotted key (`weather.wind_m_s`); UserError for any fault.

    Keys that begin with `vehicle.` are the vehicle file's: see `split_overrides`.
    """
    path = find(name)
    document = toml_file.read(path)
    vehicle = document.get("vehicle")
    if isinstance(vehicle, str) and vehicle.endswith(".toml") and os.path.isfile(path.parent / vehicle):
        document["vehicle"] = str(path.parent / vehicle)  # a user's vehicle lies beside the scenario
    for key, value in (overrides or {}).items():
        toml_file.assign(document, key, value)
    return toml_file.validate(document, Scenario, path, tuple(overrides or ()))


def build(**tables: Any) -> Scenario:
    """A scenario made in Python: the keys of the file as keyword arguments."""
    return toml_file.validate({"vehicle": "raptor90", **tables}, Scenario, "scenario")


def split_overrides(settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """`--set` keys parted into those of the scenario and those of the vehicle file (`vehicle.terms.X.y`)."""
    scenario = {key: value for key, value in settings.items() if not key.startswith(toml_file.VEHICLE)}
    vehicle = {key.removeprefix(toml_file.VEHICLE): settings[key] for key in settings if key not in scenario}
    return scenario, vehicle
