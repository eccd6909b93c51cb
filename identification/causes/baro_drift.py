"""The barometer's height drifts steadily."""

from identification import kinematics as k
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import scalars
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """Height read too high by the time since the start."""
    t = flight.motion.t
    return [Change(scalars(flight, (k.BARO, t - t[0])))]


CAUSE = Cause(
    name="baro_drift",
    where="sensor",
    parameters=(Parameter("rate", "m/s", "sensors.baro.drift_rate", 0.1),),
    about="steady drift since the start, beyond the declared wander",
    needs=("baro",),
    changes=changes,
    split_by={"gps_drift": "a second height: ranger or mark in sight at both ends"},
)
