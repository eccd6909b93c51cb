"""The down camera's stamps are off: its pictures are older than they claim."""

from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import late
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """The mark as it was at an earlier time."""
    return [Change(late(flight, vehicle, "pad"))]


CAUSE = Cause(
    name="camera_latency",
    where="timing",
    parameters=(Parameter("delay", "s", "cameras.down.stamp_delay", 0.06, tolerance="cameras.down.latency"),),
    about="age of a picture beyond its stamp",
    needs=("pad",),
    changes=changes,
)
