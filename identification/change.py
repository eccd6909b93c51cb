"""What one unit of a sensor's error adds to the measurements of a flight."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Change:
    """What one unit of a parameter adds to the measurements of one flight; None: nothing."""

    scalars: Floats | None = None  # (M,) to every scalar measurement of the motion
    force: Floats | None = None  # (N, 3) [m/s^2] to the inertial sensor's force, body axes
    rate: Floats | None = None  # (N, 3) [rad/s] to its rate
    rotor: Floats | None = None  # (N,) [rad/s] to the tachometer
    # of `kinematics`: the filter of the motion has this error as a state, which is off by one unit where it begins;
    # force and rate then say what the model meets, and may be smoothed
    state: int | None = None
    # (3, 3): rate that is added by rate there is; what a node's rate came to by itself then tells nothing of the error
    turning: Floats | None = None
