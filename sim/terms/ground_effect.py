"""Ground effect of Cheeseman and Bennett (ARC R&M 3021, 1955), fading with forward speed.

    T/T_inf = 1/(1 - k) at constant power,   k = gain (R/4z)^2 / (1 + (V/v_i)^2)

z: hub above the ground, V: horizontal airspeed, v_i: induced velocity out of ground effect. Induced power is T v_i
times the factor `ground`, and v_i = sqrt(T/(2 rho A)) in hover, so power is T^(3/2) ground / sqrt(2 rho A): the
formula holds exactly with ground = (1 - k)^(3/2).
"""

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _ground_effect(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    # x[0]: the factor of the last instant, which the last inflow carries
    height = s.height + v.hub[0] * s.up[0] + v.hub[1] * s.up[1] + v.hub[2] * s.up[2]
    height = max(height, 0.5 * v.rotor_radius)  # validity ends there (z/R >= 0.5)
    rise = s.velocity[0] * s.up[0] + s.velocity[1] * s.up[1] + s.velocity[2] * s.up[2]
    speed2 = 0.0
    for axis in range(3):
        speed2 += (s.velocity[axis] - rise * s.up[axis]) ** 2
    induced2 = (s.inflow / x[0]) ** 2 + 1e-9
    ratio = v.rotor_radius / (4.0 * height)
    k = min(p[0] * ratio * ratio * induced2 / (induced2 + speed2), 0.9)
    x[0] = (1.0 - k) ** 1.5
    s.ground = x[0]


TERM = Term(
    name="ground_effect",
    stage=Stage.INFLOW,
    kernel=_ground_effect,
    parameters=(Parameter("gain", "1", 0.0, 3.0, "on (R/4z)^2; 1 = Cheeseman and Bennett, 0 = none"),),
    states=("factor",),
    initial=(1.0,),
    source="Cheeseman & Bennett, ARC R&M 3021, 1955",
)
