"""The navigators by name. One is one module here with `NEEDS`, `look` and `build`; see `contract`."""

from importlib import import_module

from estimators.eyes import Eyes
from estimators.navigators.contract import Navigator as Navigator
from estimators.navigators.contract import Steered as Steered
from estimators.navigators.contract import Variant as Variant
from flightlog.equipment import Equipment
from flightlog.errors import UserError

NAVIGATORS: tuple[str, ...] = ("helideck", "lei2012", "wu2019", "zeng", "huang")  # each a module of this package


def make(name: str, equipment: Equipment, *, variant: Variant = "helideck", sees: bool) -> Navigator:
    """A navigator by name; `sees`: pictures will come.

    Raises:
        UserError: no navigator of that name, or a sensor is missing that it cannot do without.
    """
    if name not in NAVIGATORS:
        raise UserError(f"navigator: there is none named {name!r}; there are {', '.join(NAVIGATORS)}")
    module = import_module(f"{__name__}.{name}")
    for topic in module.NEEDS:
        if topic not in equipment.sensors:
            raise UserError(f"sensors.{topic}: is missing: the navigator {name!r} cannot do without")
    eyes = module.look(equipment, variant) if sees else Eyes()
    navigator: Navigator = module.build(equipment, eyes, variant)
    return navigator


def describe(name: str) -> str:
    """A navigator in one line."""
    return (import_module(f"{__name__}.{name}").__doc__ or "").strip().partition("\n")[0]
