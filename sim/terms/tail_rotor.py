"""Tail rotor: blade element and momentum theory in closed form, axial flow from sideslip and yaw rate.

With x = lambda_i and b = 2 mu_z + sigma a/4, equal thrust of blade element and momentum theory,

    (sigma a/2)(theta/3 - (mu_z + x)/2) = 2 x (mu_z + x)   gives   2 x^2 + b x - (sigma a/2)(theta/3 - mu_z/2) = 0

for thrust > 0, and its mirror image for thrust < 0. Air that comes fast against the thrust (mu_z < 0) has no steady
solution of that sign at small pitch; there is no thrust then. Edgewise speed is left out.
"""

import math

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _tail_rotor(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    radius, solidity, gear, lift_slope, profile_drag, trim, limit, scale = (
        p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7],
    )  # fmt: skip
    hub = v.tail_hub
    tip = max(gear * s.rotor_speed, 1e-6) * radius
    disc = s.density * math.pi * radius * radius
    side = -v.rotor_direction  # the thrust that holds the main rotor's torque points to the left under a clockwise one

    axial = side * (s.velocity[1] + s.rates[2] * hub[0] - s.rates[0] * hub[2])
    climb = axial / tip
    pitch = side * s.tail + trim
    half = 0.5 * solidity * lift_slope
    drive = pitch / 3.0 - climb / 2.0
    sign = 1.0 if drive >= 0.0 else -1.0
    b = 2.0 * sign * climb + 0.5 * half
    inflow = sign * 0.25 * (math.sqrt(b * b + 8.0 * half * sign * drive) - b)
    coefficient = scale * sign * min(max(half * sign * (drive - inflow / 2.0), 0.0), limit)

    thrust = side * coefficient * disc * tip * tip  # [N] along the body's y axis
    power = disc * tip**3 * (coefficient * (climb + inflow) + solidity * profile_drag / 8.0)
    s.tail_torque = power / max(s.rotor_speed, 1e-6)
    s.tail_thrust = thrust
    s.force[1] += thrust
    s.moment[0] -= hub[2] * thrust
    s.moment[2] += hub[0] * thrust


TERM = Term(
    name="tail_rotor",
    stage=Stage.WRENCH,
    kernel=_tail_rotor,
    parameters=(
        Parameter("radius", "m", 0.01, 5.0, "of the tail rotor"),
        Parameter("solidity", "1", 0.01, 0.5, "blades' area over disc area"),
        Parameter("gear", "1", 0.5, 20.0, "tail rotor speed over main rotor speed"),
        Parameter("lift_slope", "1", 1.0, 8.0, "of its blades, per radian"),
        Parameter("profile_drag", "1", 0.0, 0.1, "C_d0 of its blades"),
        Parameter("trim", "rad", -0.5, 0.5, "blade pitch at tail = 0, towards holding the main rotor's torque"),
        Parameter("thrust_limit", "1", 1e-3, 0.2, "largest C_T, where the blades stall"),
        Parameter("force_scale", "1", 0.0, 2.0, "thrust over that of this model", 1.0),
    ),
    source="Gavrilets 2003; Heffley & Mnich, NASA CR-177476, 1988: closed-form inflow",
)
