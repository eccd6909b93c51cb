"""The catalogue for multirotors: plant causes on the numbers of their file."""

from dataclasses import replace

import numpy as np

from identification.causes import actuator_delay, actuator_lag, battery_sag, rotor_damage
from identification.causes.contract import Cause, Parameter
from identification.multirotor.quick import DELAY, TAU
from sim.multirotor.file import Multirotor

LATE = "actuator_lag", "actuator_delay"
ADDED = 0.06  # share of the mass that is added or missing, where something is
PLACED = 0.7  # of the rotors' reach at which it sits
DRAG = 0.5  # [1/s] of drag over mass, where there is more of it
SHIFTED = 0.15  # of the rotors' reach by which a centre of mass may lie off


def catalogue(craft: Multirotor) -> list[Cause]:
    """Every cause that a multirotor's balances could show, its spreads fitted to the size of this one.

    Lags and delays show in the motion about the balance, which an inertial sensor must have seen; drag along the body
    in what it felt.
    """
    reach = float(np.sqrt(np.mean(craft.positions[:, :2] ** 2)))
    mass, volts = craft.mass, craft.numbers["terms.battery_sag.reference"].value
    sag = battery_sag.CAUSE
    rotors = [f"rotor_damage#{i + 1}" for i in range(craft.rotors)]
    added = ADDED * PLACED * reach
    return [
        Cause(
            name="mass",
            where="plant",
            parameters=(
                Parameter("mass", "kg", "mass", ADDED * mass),
                Parameter("x", "m", "terms.payload.x", added),
                Parameter("y", "m", "terms.payload.y", added),
            ),
            about="mass at the start, and where the added or missing part sits",
            kinds=("multirotor",),
            split_by={
                "thrust_scale": "a scale: nothing in flight tells mass from thrust where no force is measured alone",
                **dict.fromkeys(rotors, rotor_damage.EXCHANGED),
                "cg_offset": "a scale: a shift does not weigh",
            },
        ),
        Cause(
            name="cg_offset",
            where="plant",
            parameters=(
                Parameter("x", "m", "terms.cg_offset.x", SHIFTED * reach),
                Parameter("y", "m", "terms.cg_offset.y", SHIFTED * reach),
            ),
            about="place of the centre of mass, the total mass unchanged",
            kinds=("multirotor",),
            split_by={"mass": "a scale: a shift does not weigh", **dict.fromkeys(rotors, rotor_damage.EXCHANGED)},
        ),
        Cause(
            name="thrust_scale",
            where="plant",
            parameters=(Parameter("scale", "1", "terms.thrust.scale", 0.15),),
            about="thrust of all rotors over that of the file",
            kinds=("multirotor",),
            split_by={"mass": "a scale: nothing in flight tells mass from thrust where no force is measured alone"},
        ),
        Cause(
            name="drag",
            where="plant",
            parameters=(Parameter("linear", "N s/m", "terms.drag.linear", DRAG * mass),),
            about="drag beside that in the file, a share linear in speed",
            needs=("imu",),
            kinds=("multirotor",),
        ),
        replace(sag, parameters=(replace(sag.parameters[0], spread=battery_sag.SHARE / volts),)),
        replace(
            actuator_lag.CAUSE,
            parameters=(Parameter("tau", "s", TAU, 0.05),),
            needs=("imu",),
            kinds=("multirotor",),
            about="time constant from command to thrust",
        ),
        replace(
            actuator_delay.CAUSE,
            parameters=(Parameter("delay", "s", DELAY, 0.03),),
            needs=("imu",),
            kinds=("multirotor",),
            about="pure delay of the commands",
        ),
        *(rotor_damage.of(i + 1, craft.rotors) for i in range(craft.rotors)),
    ]


def testable(craft: Multirotor, topics: set[str], moving: bool) -> tuple[list[Cause], dict[str, list[str]]]:
    """Causes that these topics can show, and what the others lack; moving: the commands do more than answer gusts."""
    known = [c for c in catalogue(craft) if not (craft.by_speed and c.name in LATE)]
    lacking = {cause.name: [topic for topic in cause.needs if topic not in topics] for cause in known}
    for name in LATE:
        if lacking.get(name) == [] and not moving:
            lacking[name] = ["doublets"]
    return [cause for cause in known if not lacking[cause.name]], {n: m for n, m in lacking.items() if m}
