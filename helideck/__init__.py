"""Helideck: a small helicopter that sees, fuses faulty sensors, hovers over an H and lands on it.

    from helideck import fly, load_scenario
    flight = fly(load_scenario("landing"), seed=1, folder="flights/mine")
"""

from flightlog.errors import UserError as UserError
from flightlog.readers.folder import read_flight as read_flight
from flightlog.signals import Controls as Controls
from flightlog.signals import StateEstimate as StateEstimate
from scenarios.crew import make_navigator as make_navigator
from scenarios.crew import make_pilot as make_pilot
from scenarios.flight import Flight as Flight
from scenarios.flight import fly as fly
from scenarios.load import build as build_scenario
from scenarios.load import load as load_scenario
from sim.vehicle import load as load_vehicle

__all__ = [
    "Controls", "Flight", "StateEstimate", "UserError", "build_scenario", "fly", "load_scenario", "load_vehicle",
    "make_navigator", "make_pilot", "read_flight",
]  # fmt: skip
