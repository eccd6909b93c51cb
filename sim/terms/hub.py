"""What the main rotor does to the body: its thrust along the tip-path plane's normal, at the hub, and the hub's moment.

The moment per flapping angle about the body origin is K_beta + T h (Gavrilets 2003).
"""

import math

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _hub(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    stiffness, hub = p[0], v.hub
    fx = -s.thrust * math.sin(s.flap_back)
    fy = -s.thrust * math.sin(s.flap_right)
    fz = math.sqrt(max(s.thrust * s.thrust - fx * fx - fy * fy, 0.0))
    if s.thrust < 0.0:
        fz = -fz
    s.force[0] += fx
    s.force[1] += fy
    s.force[2] += fz
    s.moment[0] += hub[1] * fz - hub[2] * fy + stiffness * s.flap_right
    s.moment[1] += hub[2] * fx - hub[0] * fz - stiffness * s.flap_back
    s.moment[2] += hub[0] * fy - hub[1] * fx


TERM = Term(
    name="hub",
    stage=Stage.WRENCH,
    kernel=_hub,
    parameters=(Parameter("stiffness", "N m/rad", 0.0, 1e4, "K_beta: hub moment per flapping angle"),),
    source="Gavrilets 2003",
)
