"""What a residual may depend on, along each flight."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightlog.rotations import angles
from identification.bench import Bench

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Driver:
    """A quantity along one flight."""

    label: str  # with its unit
    t: Floats  # (N,) [s] the log's own clock
    values: Floats  # (N,)

    def at(self, t: Floats) -> Floats:
        """Values (R,) at times (R,)."""
        return np.asarray(np.interp(t, self.t, self.values))


def drivers(bench: Bench, flight: int) -> Mapping[str, Driver]:
    """By name. A bench that tells its own in `drivers(flight)`, as {name: (label, t, values)}, is believed."""
    own = getattr(bench, "drivers", None)
    if own is not None:
        return {name: Driver(*given) for name, given in own(flight).items()}
    flights = getattr(bench, "flights", None)
    motion = None if flights is None else getattr(flights[flight], "motion", None)
    if motion is None:
        rows = bench.rows(flight, {})
        t = np.unique(rows.t)
        return {"time": Driver("time [s]", t, t - t[0])}
    t, velocity = motion.t, motion.velocity
    tilt = np.degrees([angles(q) for q in motion.attitude])
    found = {
        "height": ("height [m]", motion.position[:, 2]),
        "speed": ("speed over ground [m/s]", np.hypot(velocity[:, 0], velocity[:, 1])),
        "climb": ("climb [m/s]", velocity[:, 2]),
        "time": ("time [s]", t - t[0]),
        "roll": ("roll [deg]", tilt[:, 0]),
        "pitch": ("pitch [deg]", tilt[:, 1]),
    }
    return {name: Driver(label, t, values) for name, (label, values) in found.items()}


# name in a vehicle file's box of validity, by driver
BOX = {"height": "height_m", "speed": "speed_m_s", "climb": "climb_m_s"}


def visited(bench: Bench) -> dict[str, tuple[float, float]]:
    """Least and greatest height, speed and climb on all flights: where what was found holds."""
    found: dict[str, tuple[float, float]] = {}
    for i in range(len(bench.names)):
        for name, driver in drivers(bench, i).items():
            if name not in BOX:
                continue
            low, high = float(np.nanmin(driver.values)), float(np.nanmax(driver.values))
            before = found.get(BOX[name], (low, high))
            found[BOX[name]] = min(low, before[0]), max(high, before[1])
    return found
