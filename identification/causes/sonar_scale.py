"""The ranger's speed of sound is wrong."""

import numpy as np

from identification import kinematics as k
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import scalars
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """In proportion to the distance."""
    lever = float(vehicle.sensors["sonar"].position[2])
    return [Change(scalars(flight, (k.SONAR, np.maximum(flight.motion.position[:, 2] + lever, 0.0))))]


CAUSE = Cause(
    name="sonar_scale",
    where="sensor",
    parameters=(Parameter("scale", "1", "sensors.sonar.scale", 0.05, nominal=1.0),),
    about="range measured over true",
    needs=("sonar",),
    changes=changes,
    split_by={"camera_focal": "a height from a third sensor: a landing, where the skids tell it"},
)
