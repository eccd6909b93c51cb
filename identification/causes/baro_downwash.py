"""The rotor's downwash disturbs the barometer otherwise than declared."""

import numpy as np

from identification import kinematics as k
from identification.barometer import downwash, lagged
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """Height read too low by the share of the disc loading that reaches the port."""
    surface = flight.drive.surface_pressure, flight.drive.surface_temperature
    low = lagged(downwash(vehicle, flight.skids, flight.thrust, surface), flight.baro_lag, flight.motion.step)
    motion, at = flight.motion, flight.motion.kinds == k.BARO
    found = np.zeros(len(motion.kinds))
    found[at] = -np.interp(motion.times[at] + flight.baro_lag, motion.t, low)  # times are set back by the lag
    return [Change(found)]


CAUSE = Cause(
    name="baro_downwash",
    where="sensor",
    parameters=(
        Parameter("gain", "1", "sensors.baro.downwash_gain", 0.8, tolerance="sensors.baro.downwash_gain"),
    ),
    about="pressure under the rotor near the ground, over the disc loading",
    needs=("baro",),
    changes=changes,
    split_by={"ground_effect": "hover at 0.5, 1 and 2 m with the ranger in reach: the force changes or it does not"},
)
