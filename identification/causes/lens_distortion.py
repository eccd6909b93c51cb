"""The down camera's lens bends more, or less, than it is taken to.

Brown and Conrady's first radial coefficient: a point at r from the axis (tangent) is moved outward by k1 r^2 of r. A
mark seen aside is moved along its ray and larger by 1 + 2 k1 r^2 in the mean; what a front end that weighs every
pixel of edge makes of it is `sim.sensors.pad_camera.by_lens`. Lenses that were known came out 3 to 8 % off: near the
mark a pixel more or less of it in the picture decides.
"""

import numpy as np

from identification import kinematics as k
from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.lens import bend
from identification.views import rotations
from sim.vehicle import Vehicle


def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
    """By where in the picture the mark is."""
    motion = flight.motion
    moved = bend(motion.position, rotations(flight), vehicle).moved
    scalars = np.zeros(len(motion.kinds))
    for axis in range(4):
        at = motion.kinds == k.PAD + axis
        scalars[at] = np.interp(motion.times[at], motion.t, moved[:, axis])
    return [Change(scalars)]


CAUSE = Cause(
    name="lens_distortion",
    where="sensor",
    parameters=(Parameter("k1", "1", "cameras.down.k1", 0.1, open_share=0.06),),
    about="first radial coefficient of the down camera's lens, beyond the one taken",
    needs=("pad",),
    changes=changes,
    split_by={
        "camera_focal": "hovers with the mark in the middle and at the rim of the picture: a lens bends at the rim",
        "camera_tilt": "hovers with the mark on both sides of the picture: a tilt moves it the same way",
    },
)
