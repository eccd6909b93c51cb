"""Centre of mass beside the body's origin: the force turns the body about it.

    M = M_origin - c x F

Stands last, so that it sees the whole force. What the offset adds to the origin's acceleration, of the size of c times
the angular acceleration, is left out.
"""

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _cg_offset(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    s.moment[0] -= p[1] * s.force[2] - p[2] * s.force[1]
    s.moment[1] -= p[2] * s.force[0] - p[0] * s.force[2]
    s.moment[2] -= p[0] * s.force[1] - p[1] * s.force[0]


TERM = Term(
    name="cg_offset",
    stage=Stage.BALANCE,
    kernel=_cg_offset,
    parameters=tuple(
        Parameter(axis, "m", -0.5, 0.5, f"centre of mass from the body's origin along {where}", 0.0)
        for axis, where in (("x", "forward"), ("y", "left"), ("z", "up"))
    ),
    source="moment about a shifted point",
)
