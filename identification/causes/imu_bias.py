"""Accelerometer or gyro stands off by more than declared."""

import numpy as np

from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """Each axis by itself."""
    nodes = len(flight.motion.t)
    found = []
    for axis in range(6):
        column = np.zeros((nodes, 3))
        column[:, axis % 3] = 1.0
        found.append(Change(force=column) if axis < 3 else Change(rate=column))
    return found


CAUSE = Cause(
    name="imu_bias",
    where="sensor",
    parameters=tuple(
        Parameter(axis, "m/s^2" if axis[0] == "f" else "rad/s", f"sensors.imu.bias_{axis}", spread)
        for axis, spread in zip(("fx", "fy", "fz", "wx", "wy", "wz"), (0.4,) * 3 + (0.02,) * 3, strict=True)
    ),
    about="constant error of the inertial sensor, beyond the declared statistics",
    changes=changes,
    split_by={"imu_misalignment": "steps of forward flight: a turned case shows what it does not measure in hover"},
)
