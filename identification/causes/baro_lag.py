"""The barometer follows slower than declared."""

from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import late
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """To first order a lag shows what was so long ago."""
    return [Change(late(flight, vehicle, "baro"))]


CAUSE = Cause(
    name="baro_lag",
    where="sensor",
    parameters=(Parameter("tau", "s", "sensors.baro.lag", 0.4, tolerance="sensors.baro.lag"),),
    about="first-order lag of port and tubing",
    needs=("baro",),
    changes=changes,
    split_by={"clock_offset": "climbs and descents that begin and end sharply: a lag rounds them"},
)
