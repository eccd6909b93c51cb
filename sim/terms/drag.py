"""Drag beside that of the fuselage: a flat plate's, and one that grows with the speed itself.

    F = -(rho/2 area |V| + linear) V
"""

import math

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _drag(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    speed = math.sqrt(s.velocity[0] ** 2 + s.velocity[1] ** 2 + s.velocity[2] ** 2)
    factor = 0.5 * s.density * p[0] * speed + p[1]
    for axis in range(3):
        s.force[axis] -= factor * s.velocity[axis]


TERM = Term(
    name="drag",
    stage=Stage.WRENCH,
    kernel=_drag,
    parameters=(
        Parameter("area", "m^2", 0.0, 10.0, "equivalent flat plate"),
        Parameter("linear", "N s/m", 0.0, 100.0, "per speed, as the drag of rotors is", 0.0),
    ),
    source="flat plate of unit drag coefficient",
)
