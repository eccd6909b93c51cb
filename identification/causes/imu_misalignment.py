"""The inertial sensor's case is turned against the body."""

import numpy as np

from identification import kinematics as k
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import felt
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """A case turned by the small vector a sees v - a x v."""
    force, rate = felt(flight)
    unit = np.eye(3)
    return [
        Change(
            force=-np.cross(unit[axis], force), rate=-np.cross(unit[axis], rate), state=k.CASE + axis,
            turning=-np.cross(unit[axis], unit).T,
        )
        for axis in range(3)
    ]


CAUSE = Cause(
    name="imu_misalignment",
    where="sensor",
    parameters=tuple(Parameter(axis, "rad", f"sensors.imu.misalignment_{axis}", 0.04) for axis in "xyz"),
    about="turn of the case about the body's axes, beyond the declared statistics",
    changes=changes,
    split_by={"imu_bias": "steps of forward flight: a turned case shows what it does not measure in hover"},
)
