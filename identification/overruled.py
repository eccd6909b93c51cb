"""Errors of a sensor that the other sensors speak against.

A gyro that reads a yaw rate 5 % too large turns the heading away from what magnetometer and mark say of it. Where they
do not find it so, and force and moment alone ask for it, the model is what is wrong.
"""

import numpy as np

from identification.bench import Bench
from identification.causes.contract import Cause
from identification.left_over import left_over
from identification.refit import Refit

AGAINST = 10.0  # [nats] by which the sensors among themselves are likelier without it


def overruled(bench: Bench, cause: Cause, without: Refit, within: Refit) -> bool:
    """Whether the sensors of the motion are so much likelier without a cause that is an error of one of them."""
    sensors = getattr(bench, "sensor_channels", None)
    if sensors is None or cause.changes is None:
        return False
    cost = {}
    for name, fit in (("without", without), ("within", within)):
        parts = [left[np.isin(rows.channel, sensors)] for rows, left in left_over(bench, fit)]
        cost[name] = 0.5 * sum(float(part @ part) for part in parts)
    return cost["within"] - cost["without"] > AGAINST
