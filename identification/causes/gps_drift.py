"""The receiver's position walks away."""

from identification import kinematics as k
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import scalars
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """Each axis by the time since the start."""
    t = flight.motion.t
    return [Change(scalars(flight, (k.GPS + axis, t - t[0]))) for axis in range(3)]


CAUSE = Cause(
    name="gps_drift",
    where="sensor",
    parameters=tuple(Parameter(axis, "m/s", f"sensors.gps.drift_rate_{axis}", 0.1) for axis in ("e", "n", "u")),
    about="steady drift of position, beyond the declared wander",
    needs=("gps",),
    changes=changes,
    split_by={"baro_drift": "a second height: ranger or mark in sight at both ends"},
)
