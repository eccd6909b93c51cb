"""The magnetometer stands off by more than declared."""

from identification import kinematics as k
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import scalars
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """Each axis by itself."""
    return [Change(scalars(flight, (k.FIELD + axis, 1.0))) for axis in range(3)]


CAUSE = Cause(
    name="mag_bias",
    where="sensor",
    parameters=tuple(Parameter(axis, "uT", f"sensors.mag.bias_{axis}", 3.0) for axis in "xyz"),
    about="constant error of the field, beyond the declared statistics",
    needs=("mag",),
    changes=changes,
)
