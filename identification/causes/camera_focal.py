"""The down camera's focal length is not what it is taken for."""

from identification import kinematics as k
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import pad_seen, scalars
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """A longer lens makes the mark larger: it seems nearer, and as far aside as it is."""
    depth = pad_seen(flight, vehicle)[:, 2]
    return [Change(scalars(flight, (k.PAD + 2, -depth)))]


CAUSE = Cause(
    name="camera_focal",
    where="sensor",
    parameters=(Parameter("scale", "1", "cameras.down.focal_scale", 0.04, nominal=1.0),),
    about="true focal length over the one taken",
    needs=("pad",),
    changes=changes,
    split_by={"sonar_scale": "a height from a third sensor: a landing, where the skids tell it"},
)
