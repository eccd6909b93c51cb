"""From words of the command line to what `fly` takes."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from flightlog.errors import UserError
from flightlog.toml_file import parse_value
from scenarios.load import find, load, split_overrides
from scenarios.schema import Scenario
from sim import vehicle as vehicles
from sim.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scenario with the vehicles that belong to it."""

    name: str
    scenario: Scenario
    vehicle: Vehicle  # what flies
    aboard: Vehicle  # what pilot and navigator were designed for


def parse_settings(words: Iterable[str]) -> dict[str, Any]:
    """`a.b=value` words as a mapping; UserError for one without `=`."""
    settings = {}
    for word in words:
        key, sign, value = word.partition("=")
        if not sign or not key:
            raise UserError(f"--set {word}: write it as a.b=value, for example weather.wind_m_s=4")
        settings[key.strip()] = parse_value(value.strip())
    return settings


def parse_seed(word: str) -> tuple[int, ...]:
    """`7`, or `CAMPAIGN:RUN` as in a campaign's table; UserError for anything else."""
    try:
        seed = tuple(int(part) for part in word.split(":"))
    except ValueError:
        seed = ()
    if not seed or len(seed) > 2 or min(seed) < 0:
        raise UserError(f"--seed {word}: must be a whole number from 0 on, or CAMPAIGN:RUN")
    return seed


def prepare(
    scenario: str, settings: Mapping[str, Any], *, vehicle: Path | None = None, aboard: Path | None = None
) -> Prepared:
    """Load what a flight needs; UserError for any fault in it."""
    own, changed = split_overrides(settings)
    loaded = load(scenario, own)
    return Prepared(
        name=find(scenario).stem,
        scenario=loaded,
        vehicle=vehicles.load(vehicle if vehicle is not None else loaded.vehicle, changed),
        aboard=vehicles.load(aboard if aboard is not None else loaded.vehicle),
    )


def flight_folder(name: str, seed: tuple[int, ...]) -> Path:
    """A new folder under flights/."""
    stem = f"{name}-{'-'.join(str(part) for part in seed)}"
    for number in count(1):
        folder = Path("flights") / (stem if number == 1 else f"{stem}-{number}")
        if not folder.exists():
            return folder
    raise AssertionError
