"""Force, moment or rotor torque by a table of one quantity: what a diagnosis found and nobody has an equation for.

    F = value at the quantity, linear between the points; beyond the first and the last point held

A term a pair of what acts and what it depends on, `table_force_x_height` and the like, all by one kernel: the pair
stands in two states that never change.
"""

import math
from collections.abc import Mapping

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel

POINTS = 12
ACTS: Mapping[str, str] = {
    "force_x": "N", "force_y": "N", "force_z": "N", "moment_x": "N m", "moment_y": "N m", "moment_z": "N m",
}  # fmt: skip
DRIVERS: Mapping[str, str] = {
    "height": "m", "speed": "m/s", "forward_speed": "m/s", "left_speed": "m/s", "climb": "m/s", "roll": "rad",
    "pitch": "rad", "roll_rate": "rad/s", "pitch_rate": "rad/s", "yaw_rate": "rad/s", "rotor_speed": "rad/s",
    "time": "s", "collective": "rad", "lateral": "rad", "longitudinal": "rad", "tail": "rad",
}  # fmt: skip - speeds are through the air; controls as they stand at the swash plate


@kernel
def _table(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    driver = int(x[1])
    climb = s.velocity[0] * s.up[0] + s.velocity[1] * s.up[1] + s.velocity[2] * s.up[2]
    at = 0.0
    if driver == 0:
        at = s.height
    elif driver == 1:
        square = s.velocity[0] ** 2 + s.velocity[1] ** 2 + s.velocity[2] ** 2 - climb * climb
        at = math.sqrt(max(square, 0.0))
    elif driver == 2:
        at = s.velocity[0]
    elif driver == 3:
        at = s.velocity[1]
    elif driver == 4:
        at = climb
    elif driver == 5:
        at = math.atan2(s.up[1], s.up[2])
    elif driver == 6:
        at = math.asin(max(-1.0, min(1.0, s.up[0])))
    elif driver < 10:
        at = s.rates[driver - 7]
    elif driver == 10:
        at = s.rotor_speed
    elif driver == 11:
        at = s.time
    elif driver == 12:
        at = s.collective
    elif driver == 13:
        at = s.lateral
    elif driver == 14:
        at = s.longitudinal
    else:
        at = s.tail
    # p: POINTS places, then as many values
    value = p[12]
    for i in range(11):
        if at >= p[i + 1]:
            value = p[13 + i]
        elif at > p[i]:
            value = p[12 + i] + (p[13 + i] - p[12 + i]) * (at - p[i]) / (p[i + 1] - p[i])
    acts = int(x[0])
    if acts < 3:
        s.force[acts] += value
    else:
        s.moment[acts - 3] += value


def _term(acts: str, driver: str) -> Term:
    places = (Parameter(f"at_{i}", DRIVERS[driver], -1e6, 1e6, f"{driver}, growing") for i in range(POINTS))
    values = (Parameter(f"value_{i}", ACTS[acts], -1e6, 1e6, f"{acts} there", 0.0) for i in range(POINTS))
    return Term(
        name=f"table_{acts}_{driver}",
        stage=Stage.WRENCH,
        kernel=_table,
        parameters=(*places, *values),
        states=("acts", "driver"),
        initial=(float(list(ACTS).index(acts)), float(list(DRIVERS).index(driver))),
        source="a diagnosis",
    )


TABLES: Mapping[str, Term] = {f"table_{acts}_{driver}": _term(acts, driver) for acts in ACTS for driver in DRIVERS}
