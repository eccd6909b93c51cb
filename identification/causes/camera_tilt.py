"""The down camera is mounted askew."""

from identification import kinematics as k
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import pad_seen, scalars
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """A camera rolled right side down sees the mark to the right; one pitched nose up sees it further forward."""
    x, y, z = pad_seen(flight, vehicle).T
    roll = Change(scalars(flight, (k.PAD, z), (k.PAD + 2, -x)))
    pitch = Change(scalars(flight, (k.PAD + 1, z), (k.PAD + 2, -y)))
    return [roll, pitch]


CAUSE = Cause(
    name="camera_tilt",
    where="sensor",
    parameters=tuple(Parameter(axis, "rad", f"cameras.down.{axis}", 0.04) for axis in ("roll", "pitch")),
    about="turn of the down camera against the body",
    needs=("pad",),
    changes=changes,
    split_by={"gps_bias": "hovers at 3 and 10 m over the mark: a tilt grows with height"},
)
