"""The inertial sensor's scale is off."""

import numpy as np

from identification import kinematics as k
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import felt
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """Each axis in proportion to what it measures."""
    true = np.column_stack(felt(flight))
    found = []
    for axis in range(6):
        column = np.zeros((len(flight.motion.t), 3))
        column[:, axis % 3] = true[:, axis]
        if axis < 3:
            found.append(Change(force=column))
        else:
            along = np.diag(np.eye(3)[axis - 3])
            found.append(Change(rate=column, state=k.RATE_SCALE + axis - 3, turning=along))
    return found


CAUSE = Cause(
    name="imu_scale",
    where="sensor",
    parameters=tuple(
        Parameter(axis, "1", f"sensors.imu.scale_{axis}", 0.04, nominal=1.0)
        for axis in ("fx", "fy", "fz", "wx", "wy", "wz")
    ),
    about="measured over true, each axis",
    changes=changes,
    split_by={"imu_bias": "collective doublets: a scale grows with the force, a bias does not"},
)
