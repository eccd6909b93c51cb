"""The receiver's stamps are off: what it says is older than it claims."""

from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import late
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """Position and velocity of an earlier time."""
    return [Change(late(flight, vehicle, "gps"))]


CAUSE = Cause(
    name="gps_latency",
    where="timing",
    parameters=(Parameter("delay", "s", "sensors.gps.delay", 0.15, tolerance="sensors.gps.latency"),),
    about="age of a fix beyond its stamp",
    needs=("gps",),
    changes=changes,
)
