"""Rotor speed: engine, clutch and the torques of both rotors on one shaft.

    I dOmega/dt = Q_engine - Q_rotor - Q_tail

The engine gives the power that its throttle asks for, so its torque falls with speed; the clutch drives one way
alone. The governor is the pilot's.
"""

import math

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _engine(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    power, torque_max, tau, inertia = p[0], p[1], p[2], p[3]
    speed = x[0]
    opened = min(max(s.throttle, 0.0), 1.0)
    x[1] += (opened - x[1]) * (1.0 - math.exp(-dt / tau))
    torque = x[1] * min(power / max(speed, 1e-6), torque_max)
    # the torques of both rotors are those of the last instant: they come later in the pipeline
    acceleration = (torque - s.rotor_torque - s.tail_torque) / inertia
    s.rotor_speed = speed
    s.rotor_acceleration = acceleration
    s.engine_torque = torque
    x[0] = max(speed + acceleration * dt, 0.0)
    # What the main shaft takes from the fuselage. The tail rotor's share of the engine's torque leaves the gearbox
    # through the tail drive and is reacted about the tail rotor's own axis, where it is small and left out.
    s.moment[2] -= v.rotor_direction * (torque - s.tail_torque)


TERM = Term(
    name="engine",
    stage=Stage.ROTOR_SPEED,
    kernel=_engine,
    parameters=(
        Parameter("power_max", "W", 1.0, 1e6, "shaft power at full throttle"),
        Parameter("torque_max", "N m", 0.1, 1e4, "largest torque at the main shaft, where the clutch slips"),
        Parameter("tau", "s", 0.005, 2.0, "time constant from throttle to power"),
        Parameter("inertia", "kg m^2", 1e-4, 100.0, "of all that turns, at the main shaft"),
    ),
    states=("speed", "throttle"),
    source="Gavrilets 2003, X-Cell 60 SE: power proportional to throttle",
)
