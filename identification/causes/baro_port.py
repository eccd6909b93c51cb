"""Air that passes presses on the barometer's port otherwise than declared."""

import numpy as np

from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """Nothing as yet: what the air does hangs on the wind, which is found later (`evidence.Sheet`)."""
    return [Change(np.zeros(len(flight.motion.kinds)))]


CAUSE = Cause(
    name="baro_port",
    where="sensor",
    parameters=(Parameter("coefficient", "1", "sensors.baro.port_coefficient", 0.6),),
    about="pressure coefficient of the barometer's port in the air that passes",
    needs=("baro",),
    changes=changes,
    split_by={"baro_lag": "fly at 5 m/s and more at one height: a lag shows in climbs alone"},
)
