"""Drag of the fuselage as flat plates across its three axes, the rotor's downwash on the vertical one.

F = -rho/2 |V| (S_x u, S_y v, S_z (w + v_i)),   V = (u, v, w + v_i)
"""

import math

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _fuselage(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    forward, left, up = s.velocity[0], s.velocity[1], s.velocity[2] + s.inflow
    pressure = 0.5 * s.density * math.sqrt(forward * forward + left * left + up * up)
    s.force[0] -= pressure * p[0] * forward
    s.force[1] -= pressure * p[1] * left
    s.force[2] -= pressure * p[2] * up


TERM = Term(
    name="fuselage",
    stage=Stage.WRENCH,
    kernel=_fuselage,
    parameters=(
        Parameter("frontal_area", "m^2", 0.0, 50.0, "drag area seen from ahead"),
        Parameter("side_area", "m^2", 0.0, 50.0, "drag area seen from the side"),
        Parameter("plan_area", "m^2", 0.0, 50.0, "drag area seen from above"),
    ),
    source="Gavrilets 2003",
)
