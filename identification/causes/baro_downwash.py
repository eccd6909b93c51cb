"""The rotor's downwash disturbs the barometer otherwise than declared."""

from identification import kinematics as k
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight, downwash
from identification.views import scalars
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """Height read too low by the share of the disc loading that reaches the port."""
    surface = flight.drive.surface_pressure, flight.drive.surface_temperature
    return [Change(scalars(flight, (k.BARO, -downwash(vehicle, flight.skids, flight.thrust, surface))))]


CAUSE = Cause(
    name="baro_downwash",
    where="sensor",
    parameters=(
        Parameter("gain", "1", "sensors.baro.downwash_gain", 0.8, tolerance="sensors.baro.downwash_gain"),
    ),
    about="pressure under the rotor near the ground, over the disc loading",
    needs=("baro",),
    changes=changes,
    split_by={"ground_effect": "hover at 0.5, 1 and 2 m with the ranger in reach: the force changes or it does not"},
)
