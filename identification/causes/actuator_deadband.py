"""Slack between command and servo: backlash, or one that sticks and then goes all the way.

What sticks is told by where it breaks loose, which another slack soon does elsewhere: its likelihood has a ridge of
half a milliradian.
"""

import numpy as np

from identification.causes.contract import Cause, Parameter

WIDTHS = {0.0: np.arange(0.002, 0.021, 0.003), 1.0: np.arange(0.002, 0.0201, 0.0004)}  # [rad] by release
NEAR = np.arange(-6e-4, 6.1e-4, 1e-4)  # [rad]


def _starts(known: tuple[float, ...] | None) -> list[tuple[float, ...]]:
    if known is not None:
        width, release = known
        return [(max(float(width + by), 0.0), release) for by in NEAR]
    return [(float(width), release) for release, widths in WIDTHS.items() for width in widths]


CAUSE = Cause(
    name="actuator_deadband",
    where="plant",
    parameters=(
        Parameter("width", "rad", "terms.deadband.width", 0.01),
        Parameter("release", "1", "terms.deadband.release", 1.0),
    ),
    about="play of each control",
    starts=_starts,
)
