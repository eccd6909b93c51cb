"""What can be wrong with a quadrotor, by the name of its cause, with sizes and signs drawn; see `effects`.

`numbers` are those of the vehicle file as they then are; `otherwise` what stands in other equations.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from sim.multirotor import Multirotor
from tests.blind.effects import Effect, signed

Rng = np.random.Generator
Numbers = Mapping[str, float]
Draw = Callable[[Multirotor, Numbers, Rng, float], Effect]  # file, the vehicle as it is, randomness, share of the usual


def _reach(craft: Multirotor) -> float:
    return float(np.sqrt(np.mean(craft.positions[:, :2] ** 2)))


def _mass(craft: Multirotor, true: Numbers, rng: Rng, share: float) -> Effect:
    """Something hangs under an arm, or is missing there."""
    added = share * signed(rng, 0.07, 0.15) * true["mass"]
    angle, far = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.2, 0.8) * _reach(craft)
    x, y, whole = far * math.cos(angle), far * math.sin(angle), true["mass"] + added
    moved = {"x": added * x / whole, "y": added * y / whole}
    numbers = {"mass": whole, **{f"terms.payload.{a}": v for a, v in moved.items()}}
    form = "catalogue"
    if rng.random() < 0.5:  # as a point mass it turns with the body
        form = "point mass"
        left = added * true["mass"] / whole
        numbers |= {"inertia.0": true["inertia.0"] + left * y * y, "inertia.1": true["inertia.1"] + left * x * x,
                    "inertia.2": true["inertia.2"] + left * (x * x + y * y)}  # fmt: skip
    return Effect("mass", "plant", form, values={"mass": whole, **moved}, numbers=numbers)


def _cg_offset(craft: Multirotor, true: Numbers, rng: Rng, share: float) -> Effect:
    angle, far = rng.uniform(0.0, 2.0 * math.pi), share * rng.uniform(0.06, 0.15) * _reach(craft)
    at = {a: true[f"terms.cg_offset.{a}"] + far * f(angle) for a, f in (("x", math.cos), ("y", math.sin))}
    return Effect("cg_offset", "plant", "catalogue", values=at,
                  numbers={f"terms.cg_offset.{a}": v for a, v in at.items()})  # fmt: skip


def _thrust_scale(craft: Multirotor, true: Numbers, rng: Rng, share: float) -> Effect:
    value = true["terms.thrust.scale"] * (1.0 + share * signed(rng, 0.1, 0.2))
    if rng.random() < 0.5:  # propellers of another curve, which where they carry the weight give another share
        power = 0.15 * signed(rng, 0.5, 1.0)
        each = float(np.mean([true[f"rotors.{i}.thrust_scale"] for i in range(craft.rotors)]))
        there = value * (true["mass"] / craft.mass / (value * each)) ** (power / (1.0 + power))
        return Effect("thrust_scale", "plant", "curve", values={"scale": there}, numbers={"terms.thrust.scale": value},
                      otherwise={"curve": power})  # fmt: skip
    return Effect("thrust_scale", "plant", "catalogue", values={"scale": value}, numbers={"terms.thrust.scale": value})


def _rotor_damage(craft: Multirotor, true: Numbers, rng: Rng, share: float) -> Effect:
    rotor = int(rng.integers(craft.rotors))
    key = f"rotors.{rotor}.thrust_scale"
    value = true[key] * (1.0 - share * float(rng.uniform(0.08, 0.25)))
    found = Effect("rotor_damage", "plant", "catalogue", values={"scale": value}, numbers={key: value},
                   which=str(rotor + 1))  # fmt: skip
    if rng.random() < 0.5:  # a tip cut off: what is left drags more than it lifts, and shakes
        return Effect("rotor_damage", "plant", "cut", values={"scale": value}, numbers={key: value},
                      which=str(rotor + 1), otherwise={"torque_kept": 0.3, "shake": 2.0})  # fmt: skip
    return found


def _battery_sag(craft: Multirotor, true: Numbers, rng: Rng, share: float) -> Effect:
    """Thrust falls with the voltage below the one at which the file's thrust was found."""
    size, there = share * float(rng.uniform(0.8, 1.8)), true["terms.battery_sag.reference"]
    form = str(rng.choice(["catalogue", "power", "steps"]))
    if form == "power":
        return Effect("battery_sag", "plant", form, otherwise={"sag_power": size}, needs=("battery",))
    value = true["terms.battery_sag.sag"] + size / there
    hold = {"sag_hold": float(rng.uniform(2.0, 5.0))} if form == "steps" else {}
    return Effect("battery_sag", "plant", form, values={"sag": value}, numbers={"terms.battery_sag.sag": value},
                  otherwise=hold, needs=("battery",))  # fmt: skip


def _drag(craft: Multirotor, true: Numbers, rng: Rng, share: float) -> Effect:
    size = share * float(rng.uniform(0.4, 0.8)) * craft.mass  # [N s/m]
    if rng.random() < 0.5:
        return Effect("drag", "plant", "power",
                      otherwise={"drag_factor": size, "drag_power": float(rng.uniform(1.3, 1.7))})  # fmt: skip
    value = true["terms.drag.linear"] + size
    return Effect("drag", "plant", "linear", values={"linear": value, "area": true["terms.drag.area"]},
                  numbers={"terms.drag.linear": value})  # fmt: skip


def _actuator_lag(craft: Multirotor, true: Numbers, rng: Rng, share: float) -> Effect:
    more = share * float(rng.uniform(0.03, 0.06))
    value = true["terms.motor.tau"] + more
    if rng.random() < 0.5:
        return Effect("actuator_lag", "plant", "second order", otherwise={"second_lag": more})
    return Effect("actuator_lag", "plant", "catalogue", values={"tau": value}, numbers={"terms.motor.tau": value})


def _actuator_delay(craft: Multirotor, true: Numbers, rng: Rng, share: float) -> Effect:
    more = share * float(rng.uniform(0.02, 0.045))
    if rng.random() < 0.5 and more >= 0.01:
        frames = max(0, round(more / 0.01 - 0.5))
        return Effect("actuator_delay", "timing", "frames", values={"delay": (frames + 0.5) * 0.01 - 0.001},
                      otherwise={"frame": 0.01, "frames": float(frames)})  # fmt: skip
    return Effect("actuator_delay", "timing", "catalogue", values={"delay": more}, numbers={"terms.motor.delay": more})


def _cushion(craft: Multirotor, true: Numbers, rng: Rng, share: float) -> Effect:
    size = float(np.abs(craft.positions).max()) * 6.0
    return Effect("cushion", "plant", "unknown",
                  otherwise={"cushion": share * float(rng.uniform(0.15, 0.35)), "cushion_height": size})  # fmt: skip


def _speed_lift(craft: Multirotor, true: Numbers, rng: Rng, share: float) -> Effect:
    fast = 0.6 if float(np.abs(craft.positions).max()) < 0.1 else 2.4  # [m/s] of a box
    return Effect("speed_lift", "plant", "unknown",
                  otherwise={"speed_lift": share * signed(rng, 0.8, 1.5) * craft.mass / fast**2})  # fmt: skip


EFFECTS: Mapping[str, Draw] = {
    "mass": _mass, "cg_offset": _cg_offset, "thrust_scale": _thrust_scale, "rotor_damage": _rotor_damage,
    "battery_sag": _battery_sag, "drag": _drag, "actuator_lag": _actuator_lag, "actuator_delay": _actuator_delay,
}  # fmt: skip
UNKNOWN: Mapping[str, tuple[Draw, str, str]] = {
    "cushion": (_cushion, "force_z", "height"), "speed_lift": (_speed_lift, "force_z", "speed"),
}  # fmt: skip
