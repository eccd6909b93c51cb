"""The receiver's position stands off by more than declared."""

from identification import kinematics as k
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import scalars
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """Each axis by itself."""
    return [Change(scalars(flight, (k.GPS + axis, 1.0))) for axis in range(3)]


CAUSE = Cause(
    name="gps_bias",
    where="sensor",
    parameters=tuple(Parameter(axis, "m", f"sensors.gps.bias_{axis}", 4.0) for axis in ("e", "n", "u")),
    about="constant error of position, beyond the declared statistics",
    needs=("gps", "pad"),
    changes=changes,
)
