"""The barometer follows slower than declared."""

import numpy as np

from identification import kinematics as k
from identification.barometer import downwash, lagged
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from sim.vehicle import Vehicle

LESS, MORE = 0.1, 0.3  # [s] over which the slope is taken: a lag is not linear in its time constant


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """The height as a slower lag gives it less that of a quicker one, with what the rotor adds to it."""
    motion, lag = flight.motion, flight.baro_lag
    quick, slow = max(lag - LESS, 0.0), lag + MORE
    surface = flight.drive.surface_pressure, flight.drive.surface_temperature
    gain = vehicle.sensors["baro"].numbers["downwash_gain"]
    height = motion.position[:, 2] - gain * downwash(vehicle, flight.skids, flight.thrust, surface)
    slope = (lagged(height, slow, motion.step) - lagged(height, quick, motion.step)) / (slow - quick)
    found, at = np.zeros(len(motion.kinds)), motion.kinds == k.BARO
    found[at] = np.interp(motion.times[at] + lag, motion.t, slope)  # which are set back by the lag
    return [Change(found)]


CAUSE = Cause(
    name="baro_lag",
    where="sensor",
    parameters=(Parameter("tau", "s", "sensors.baro.lag", 0.4, tolerance="sensors.baro.lag"),),
    about="first-order lag of port and tubing",
    needs=("baro",),
    changes=changes,
    split_by={"clock_offset": "climbs and descents that begin and end sharply: a lag rounds them"},
)
