"""Main rotor: blade element and momentum theory with inflow that takes its time.

Thrust of untwisted blades (Gavrilets 2003; Johnson, Helicopter Theory, chapter 5):

    C_T = (sigma a/2) (theta (1/3 + mu^2/2) - (mu_z + lambda_i)/2)

Momentum, with the apparent mass of the air about the disc (Pitt and Peters 1981), written with dimensions:

    m_air dv_i/dt = T - 2 rho A v_i sqrt(V^2 + (w + v_i)^2),   m_air = inflow_mass rho A R,  inflow_mass = 8/(3 pi)

At rest that is v_i = T/(2 rho A sqrt(V^2 + (w + v_i)^2)); in hover a change dies away with 0.849/(4 lambda Omega),
45 ms here, at a given thrust. Torque from induced, climb and profile power.

Vortex ring (0.3 to 1.5 v_h of sink, here 1 to 5 m/s) is beyond momentum theory. The equation above has no
singularity there: it keeps the branch of hover and climb, the mean of which lies up to 12 % under measured inflow,
and has none of the fluctuation. Descents that are to be believed stay slower than 0.3 v_h.
"""

import math

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _main_rotor(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    lift_slope, profile_drag, induced_factor, inflow_mass, limit, scale = p[0], p[1], p[2], p[3], p[4], p[5]
    radius, hub = v.rotor_radius, v.hub
    tip = s.rotor_speed * radius
    disc = s.density * math.pi * radius * radius  # [kg/m] rho A

    # the hub against the air
    wx, wy, wz = s.rates[0], s.rates[1], s.rates[2]
    forward = s.velocity[0] + wy * hub[2] - wz * hub[1]
    left = s.velocity[1] + wz * hub[0] - wx * hub[2]
    climb = s.velocity[2] + wx * hub[1] - wy * hub[0]
    edge2 = forward * forward + left * left

    # thrust at the inflow as it stands, and what the inflow makes of it
    lift = 0.5 * disc * v.rotor_solidity * lift_slope * scale
    highest = limit * disc * tip * tip
    free = lift * (s.collective * (tip * tip / 3.0 + edge2 / 2.0) - tip * (climb + s.ground * x[0]) / 2.0)
    thrust = min(max(free, -highest), highest)
    flow = math.sqrt(edge2 + (climb + x[0]) ** 2)
    steepness = 2.0 * disc * (flow + (x[0] * (climb + x[0]) / flow if flow > 0.0 else 0.0))
    if thrust == free:
        steepness += lift * tip * s.ground / 2.0
    # linearly implicit Euler: stable at any tick
    x[0] += dt * (thrust - 2.0 * disc * x[0] * flow) / (inflow_mass * disc * radius + dt * max(steepness, 0.0))

    free = lift * (s.collective * (tip * tip / 3.0 + edge2 / 2.0) - tip * (climb + s.ground * x[0]) / 2.0)
    thrust = min(max(free, -highest), highest)
    s.thrust = thrust
    s.inflow = s.ground * x[0]
    # profile power rho A (Omega R)^3 sigma C_d0/8 (1 + 4.65 mu^2), good to mu = 0.5
    profile = disc * v.rotor_solidity * profile_drag / 8.0 * (tip * tip + 4.65 * min(edge2, 0.25 * tip * tip))
    s.rotor_torque = thrust * (induced_factor * s.inflow + climb) / max(s.rotor_speed, 1e-6) + profile * radius


TERM = Term(
    name="main_rotor",
    stage=Stage.THRUST,
    kernel=_main_rotor,
    parameters=(
        Parameter("lift_slope", "1", 1.0, 8.0, "of the blades, per radian"),
        Parameter("profile_drag", "1", 0.0, 0.1, "C_d0 of the blades"),
        Parameter("induced_factor", "1", 1.0, 1.5, "induced power over that of uniform inflow", 1.0),
        Parameter("inflow_mass", "1", 0.05, 5.0, "apparent mass of the air over rho A R", 8.0 / (3.0 * math.pi)),
        Parameter("thrust_limit", "1", 1e-3, 0.05, "largest C_T, where the blades stall"),
        Parameter("thrust_scale", "1", 0.2, 2.0, "blade lift over that of this model", 1.0),
    ),
    states=("inflow",),
    source="Johnson 1980; Pitt & Peters 1981; Gavrilets 2003",
)
