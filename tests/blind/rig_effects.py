"""What can be wrong with a rig of two hinges, by the name of its cause, with sizes drawn; see `effects`."""

from collections.abc import Callable, Mapping

import numpy as np

from sim.rig import Rig
from tests.blind.effects import Effect
from tests.blind.rig_flights import SIZE

Rng = np.random.Generator
Numbers = Mapping[str, float]
Draw = Callable[[Rig, Numbers, Rng, float], Effect]

USUAL = 0.4 * sum(SIZE)  # [V] of an input at work


def _torque(rig: Rig, true: Numbers, joint: str) -> float:
    """[N m] that the inputs usually put on a joint."""
    return USUAL * max(abs(true.get(f"inputs.{name}.torque.{joint}", 0.0)) for name in rig.inputs)


def _joint_friction(rig: Rig, true: Numbers, rng: Rng, share: float) -> Effect:
    joint = str(rng.choice(rig.joints))
    dry = share * float(rng.uniform(0.1, 0.3)) * _torque(rig, true, joint)
    stem = f"terms.joint_friction.{joint}"
    viscous = true[f"{stem}.viscous"]
    form = str(rng.choice(["dry", "Stribeck", "both"]))
    if form == "Stribeck":  # more holds at rest than while it moves
        return Effect("joint_friction", "plant", form, values={"coulomb": dry, "viscous": viscous}, which=joint,
                      numbers={f"{stem}.coulomb": dry},
                      otherwise={f"{joint}.extra_stiction": 0.3 * dry, f"{joint}.extra_speed": 0.05})  # fmt: skip
    if form == "both":
        viscous *= 1.0 + share * float(rng.uniform(0.3, 0.8))
    return Effect("joint_friction", "plant", form, values={"coulomb": dry, "viscous": viscous}, which=joint,
                  numbers={f"{stem}.coulomb": dry, f"{stem}.viscous": viscous})  # fmt: skip


def _joint_stiffness(rig: Rig, true: Numbers, rng: Rng, share: float) -> Effect:
    joint = str(rng.choice(rig.joints))
    stiffness = share * float(rng.uniform(0.15, 0.5)) * _torque(rig, true, joint)
    centre = float(rng.uniform(-0.5, 0.5))
    stem = f"terms.joint_stiffness.{joint}"
    if rng.random() < 0.4:  # a cable that stiffens as it is twisted
        return Effect("joint_stiffness", "plant", "cable", which=joint, numbers={f"{stem}.centre": centre},
                      otherwise={f"{joint}.cubic": stiffness})  # fmt: skip
    return Effect("joint_stiffness", "plant", "spring", values={"stiffness": stiffness, "centre": centre}, which=joint,
                  numbers={f"{stem}.stiffness": stiffness, f"{stem}.centre": centre})  # fmt: skip


def _input_nonlinearity(rig: Rig, true: Numbers, rng: Rng, share: float) -> Effect:
    name = str(rng.choice(rig.inputs))
    form = str(rng.choice(["deadband", "power", "soft", "expo"]))
    stem = f"terms.input_nonlinearity.{name}"
    if form == "deadband":
        width = share * float(rng.uniform(0.08, 0.2))
        return Effect("input_nonlinearity", "plant", form, values={"deadband": width, "exponent": 1.0}, which=name,
                      numbers={f"{stem}.deadband": width})  # fmt: skip
    if form == "power":
        power = 1.0 + share * float(rng.uniform(0.3, 0.7))
        return Effect("input_nonlinearity", "plant", form, values={"deadband": 0.0, "exponent": power}, which=name,
                      numbers={f"{stem}.exponent": power})  # fmt: skip
    own = {f"{name}.soft": share * 0.3} if form == "soft" else {f"{name}.expo": share * float(rng.uniform(0.4, 0.8))}
    return Effect("input_nonlinearity", "plant", form, which=name, otherwise=own)


def _actuator_lag(rig: Rig, true: Numbers, rng: Rng, share: float) -> Effect:
    name = str(rng.choice(rig.inputs))
    key, more = f"terms.actuator_lag.{name}.tau", share * float(rng.uniform(0.1, 0.3))
    if rng.random() < 0.5:
        return Effect("actuator_lag", "plant", "second order", which=name,
                      otherwise={f"{name}.second_lag": more})  # fmt: skip
    return Effect("actuator_lag", "plant", "catalogue", values={"tau": true[key] + more}, which=name,
                  numbers={key: true[key] + more})  # fmt: skip


def _cogging(rig: Rig, true: Numbers, rng: Rng, share: float) -> Effect:
    size = share * float(rng.uniform(0.25, 0.5)) * _torque(rig, true, rig.joints[0])
    return Effect("cogging", "plant", "unknown", which=rig.joints[0],
                  otherwise={f"{rig.joints[0]}.cogging": size, f"{rig.joints[0]}.poles": 5.0})  # fmt: skip


def _churning(rig: Rig, true: Numbers, rng: Rng, share: float) -> Effect:
    size = share * float(rng.uniform(0.3, 0.6)) * _torque(rig, true, rig.joints[0])
    return Effect("churning", "plant", "unknown", which=rig.joints[0],
                  otherwise={f"{rig.joints[0]}.churning": size})  # fmt: skip


EFFECTS: Mapping[str, Draw] = {
    "joint_friction": _joint_friction, "joint_stiffness": _joint_stiffness,
    "input_nonlinearity": _input_nonlinearity, "actuator_lag": _actuator_lag,
}  # fmt: skip
# effect, the channel's joint, what it depends on
UNKNOWN: Mapping[str, tuple[Draw, str, str]] = {
    "cogging": (_cogging, "joints.pan", "pan"), "churning": (_churning, "joints.pan", "pan_rate"),
}  # fmt: skip
