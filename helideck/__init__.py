"""Helideck: a small helicopter that sees, fuses faulty sensors, hovers over an H and lands on it.

    from helideck import fly, load_scenario
    flight = fly(load_scenario("landing"), seed=1, folder="flights/mine")

The names are imported when first used, so that the command line's help comes at once.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flightlog.errors import UserError as UserError
    from flightlog.readers.folder import read_flight as read_flight
    from flightlog.readers.recognise import read_log as read_log
    from flightlog.signals import Controls as Controls
    from flightlog.signals import StateEstimate as StateEstimate
    from scenarios.crew import make_navigator as make_navigator
    from scenarios.crew import make_pilot as make_pilot
    from scenarios.flight import Flight as Flight
    from scenarios.flight import fly as fly
    from scenarios.load import build as build_scenario  # noqa: F401
    from scenarios.load import load as load_scenario  # noqa: F401
    from sim.vehicle import load as load_vehicle  # noqa: F401

_WHERE = {
    "UserError": "flightlog.errors",
    "read_flight": "flightlog.readers.folder",
    "read_log": "flightlog.readers.recognise",
    "Controls": "flightlog.signals",
    "StateEstimate": "flightlog.signals",
    "make_navigator": "scenarios.crew",
    "make_pilot": "scenarios.crew",
    "Flight": "scenarios.flight",
    "fly": "scenarios.flight",
    "build_scenario": "scenarios.load:build",
    "load_scenario": "scenarios.load:load",
    "load_vehicle": "sim.vehicle:load",
}
__all__ = sorted(_WHERE)


def __getattr__(name: str) -> Any:
    """Import a name of `__all__` from where it lives."""
    if name not in _WHERE:
        raise AttributeError(f"module 'helideck' has no {name!r}")
    module, _, attribute = _WHERE[name].partition(":")
    return getattr(import_module(module), attribute or name)


def __dir__() -> list[str]:
    """The names that scripts import."""
    return __all__
