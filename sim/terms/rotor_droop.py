"""Rotor speed that gives way under load: less of the throttle reaches the engine the more torque the rotors take.

    throttle' = throttle (1 - droop (Q_rotor + Q_tail) / Q_hover)

With an engine whose power goes with its throttle, P = Q Omega, and the throttle as it is, the speed at which the
torques balance falls by the share `droop` for each hover torque: the droop of a governor (proportional, without
integral) or of a carburettor's linkage that gives. Q_hover is that of momentum theory at a figure of merit of 0.6,
the weight carried in the standard atmosphere at the nominal speed.
"""

import math

from flightlog.constants import GRAVITY
from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel

FIGURE_OF_MERIT = 0.4
SEA_LEVEL = 1.225  # [kg/m^3]


@kernel
def _rotor_droop(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    weight = v.mass * GRAVITY
    inflow = math.sqrt(weight / (2.0 * SEA_LEVEL * math.pi)) / v.rotor_radius
    hover = weight * inflow / (FIGURE_OF_MERIT * v.nominal_speed)
    # the torques are those of the last instant: they come later in the pipeline
    s.throttle *= 1.0 - p[0] * (s.rotor_torque + s.tail_torque) / hover


TERM = Term(
    name="rotor_droop",
    stage=Stage.MASS,
    kernel=_rotor_droop,
    parameters=(Parameter("droop", "1", -0.5, 0.5, "share of speed lost for a hover's torque"),),
    source="proportional governor; Q_hover: Leishman, Principles of Helicopter Aerodynamics, section 2.8",
)
