"""Tail fins: lift that grows with the flow along them, drag across them (Gavrilets 2003).

    F = -rho/2 S (C_La V_along + |V_across|) V_across, no more than rho/2 S V^2

The vertical fin stands at the tail rotor's hub; the horizontal one lies in the rotor's downwash.
"""

import math

import numba

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@numba.njit(cache=True)
def _force(area, slope, along, across):  # type: ignore[no-untyped-def]
    """Force over density [m^4/s^2] across a fin in a flow along and across it [m/s]."""
    across2 = across * across
    size = min(slope * abs(along * across) + across2, along * along + across2)
    return -0.5 * area * math.copysign(size, across)


@kernel
def _fins(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    vertical, vertical_slope, horizontal, horizontal_slope, arm = p[0], p[1], p[2], p[3], p[4]
    hub = v.tail_hub
    wx, wy, wz = s.rates[0], s.rates[1], s.rates[2]

    side = s.density * _force(
        vertical, vertical_slope, s.velocity[0] + wy * hub[2], s.velocity[1] + wz * hub[0] - wx * hub[2]
    )
    s.force[1] += side
    s.moment[0] -= hub[2] * side
    s.moment[2] += hub[0] * side

    lift = s.density * _force(horizontal, horizontal_slope, s.velocity[0], s.velocity[2] + wy * arm + s.inflow)
    s.force[2] += lift
    s.moment[1] += arm * lift


TERM = Term(
    name="fins",
    stage=Stage.WRENCH,
    kernel=_fins,
    parameters=(
        Parameter("vertical_area", "m^2", 0.0, 10.0, "of the vertical fin"),
        Parameter("vertical_slope", "1", 0.0, 8.0, "its lift per radian"),
        Parameter("horizontal_area", "m^2", 0.0, 10.0, "of the horizontal fin"),
        Parameter("horizontal_slope", "1", 0.0, 8.0, "its lift per radian"),
        Parameter("horizontal_arm", "m", 0.0, 10.0, "horizontal fin behind the body origin"),
    ),
    source="Gavrilets 2003",
)
