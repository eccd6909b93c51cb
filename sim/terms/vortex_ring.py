"""Loss of thrust where the rotor sinks into its own wake.

    T = T_0 (1 - depth w(V_d / v_h)),   w = exp(-((V_d/v_h - 1)/0.35)^2) / (1 + (V/v_h)^2)

V_d: sink of the disc through the air, V: speed along the disc, v_h: induced velocity that carries the thrust in hover.
The dip lies where measured mean inflow departs from momentum theory (Leishman, chapter 2: 0.5 to 1.5 v_h).
"""

import math

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _vortex_ring(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    disc = math.pi * v.rotor_radius * v.rotor_radius
    hover = math.sqrt(max(s.thrust, 1e-6) / (2.0 * s.density * disc))
    sink = -s.velocity[2] / hover
    along2 = (s.velocity[0] ** 2 + s.velocity[1] ** 2) / (hover * hover)
    share = math.exp(-(((sink - 1.0) / 0.35) ** 2)) / (1.0 + along2)
    s.thrust *= 1.0 - p[0] * share


TERM = Term(
    name="vortex_ring",
    stage=Stage.FLAPPING,
    kernel=_vortex_ring,
    parameters=(Parameter("depth", "1", -0.5, 0.9, "share of the thrust lost at the deepest"),),
    source="shape after the inflow measured in descent; Leishman, Principles of Helicopter Aerodynamics, chapter 2",
)
