"""Tip-path plane of a rotor with flybar: first order, both axes coupled by the stiffness of the hub.

With z = back + i right, turn = wy - i wx and D the rotor's direction (Gavrilets 2003 for the form and the speed
derivative; cross-coupling by the stiffness number S = 8 (nu^2 - 1)/gamma, Padfield 1996, chapter 3):

    dz/dt = turn + (cyclic + speed - (1 + i D S) z)/tau
    cyclic = gain (Omega/Omega_0)^2 (-longitudinal + i lateral)
    speed  = 2 K_mu (4/3 collective - lambda) (u + i v)/(Omega R)

A plane that nobody commands stays behind in space when the body turns (turn), leans away from where the hub flies
(speed), and is drawn after the shaft with tau = 16/(gamma_flybar Omega). In a stiff hub the blade answers less than
a quarter turn later, so a command forward leans a clockwise rotor to the left as well.
"""

import cmath

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _flapping(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    ratio = s.rotor_speed / v.nominal_speed
    tau = p[0] / max(ratio, 0.1)
    tip = max(s.rotor_speed, 0.1 * v.nominal_speed) * v.rotor_radius
    wx, wy, wz = s.rates[0], s.rates[1], s.rates[2]
    forward = s.velocity[0] + wy * v.hub[2] - wz * v.hub[1]
    left = s.velocity[1] + wz * v.hub[0] - wx * v.hub[2]
    lean = 2.0 * p[4] * (4.0 / 3.0 * s.collective - s.inflow / tip) / tip
    into = ratio * ratio * complex(-p[2] * s.longitudinal, p[1] * s.lateral) + lean * complex(forward, left)
    pull = complex(1.0, v.rotor_direction * p[3]) / tau
    rest = (into / tau + complex(wy, -wx)) / pull
    z = rest + (complex(x[0], x[1]) - rest) * cmath.exp(-pull * dt)
    size = abs(z)
    if size > p[5]:
        z *= p[5] / size
    x[0], x[1] = z.real, z.imag
    s.flap_back, s.flap_right = x[0], x[1]


TERM = Term(
    name="flapping",
    stage=Stage.FLAPPING,
    kernel=_flapping,
    parameters=(
        Parameter("tau", "s", 0.005, 1.0, "time constant with flybar at nominal rotor speed"),
        Parameter("lateral_gain", "1", 0.0, 10.0, "flapping per lateral cyclic, at rest and nominal rotor speed"),
        Parameter("longitudinal_gain", "1", 0.0, 10.0, "flapping per longitudinal cyclic, the same"),
        Parameter("coupling", "1", -1.0, 1.0, "stiffness number: flapping across over flapping along"),
        Parameter("speed_derivative", "1", 0.0, 2.0, "K_mu: share of the speed's flapping that the flybar leaves"),
        Parameter("flap_max", "rad", 0.01, 0.5, "where the head meets its stops"),
    ),
    states=("back", "right"),
    source="Gavrilets 2003; Padfield 1996",
)
