"""Rigs: any hinged MJCF whose joints are driven by inputs; its vehicle file, every number with unit and source.

What the inputs do is command -> delay and lag -> deadband and power -> torque on each joint; joints have friction
(viscous, dry, stiction) and springs. `load` reads a file of kind `rig`; `sim.rig_motion` moves it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np
from pydantic import Field

import assets
from flightlog import toml_file
from flightlog.errors import UserError
from sim.parameters import Parameter
from sim.vehicle import find
from sim.vehicle_extension import Extension
from sim.vehicle_numbers import Number, Reader, Strict

Owner = Literal["joint", "input"]


@dataclass(frozen=True)
class RigTerm:
    """An effect on one joint or one input, and its parameters; all of them do nothing by default."""

    name: str
    owner: Owner
    parameters: tuple[Parameter, ...]
    about: str


FRICTION = RigTerm("joint_friction", "joint", (
    Parameter("viscous", "N m s/rad", 0.0, 1e3, "torque per rate", 0.0),
    Parameter("quadratic", "N m s^2/rad^2", 0.0, 1e3, "torque per square of the rate", 0.0),
    Parameter("coulomb", "N m", 0.0, 1e4, "dry friction while it moves", 0.0),
    Parameter("stiction", "N m", 0.0, 1e4, "by how much more holds it at rest", 0.0),
    Parameter("speed", "rad/s", 1e-4, 1e2, "rate over which stiction is lost", 0.1),
), "friction of a joint: viscous, quadratic, dry, and what more it takes to break loose (Stribeck)")  # fmt: skip
STIFFNESS = RigTerm("joint_stiffness", "joint", (
    Parameter("stiffness", "N m/rad", 0.0, 1e4, "torque per angle", 0.0),
    Parameter("cubic", "N m/rad^3", 0.0, 1e4, "torque per cube of the angle: a cable that stiffens", 0.0),
    Parameter("centre", "rad", -1e3, 1e3, "angle at which it is slack", 0.0),
), "a spring, or a cable that is twisted, across a joint")  # fmt: skip
LAG = RigTerm("actuator_lag", "input", (
    Parameter("tau", "s", 0.0, 60.0, "time constant", 0.0),
    Parameter("delay", "s", 0.0, 10.0, "pure delay", 0.0),
), "an input that acts late")  # fmt: skip
NONLINEARITY = RigTerm("input_nonlinearity", "input", (
    Parameter("deadband", "1", 0.0, 1e4, "input below which nothing happens, in the input's own unit", 0.0),
    Parameter("exponent", "1", 0.1, 5.0, "power of what lies above it", 1.0),
), "an input that acts by a power of what exceeds a deadband")  # fmt: skip
TERMS: Mapping[str, RigTerm] = {term.name: term for term in (FRICTION, STIFFNESS, LAG, NONLINEARITY)}


class Body(Strict):
    """Numbers of the MJCF's body that stand here instead of there."""

    mass: Number | None = None
    centre: Number | None = None  # of mass, in the body's frame
    inertia: Number | None = None  # about it, body axes


class Input(Strict):
    """What drives the rig: torque per unit of the input, by joint."""

    unit: str
    torque: dict[str, Number] = Field(min_length=1)


class Joint(Strict):
    """How well an angle is measured."""

    noise: Number


class RigFile(Strict):
    """The whole file, as written."""

    kind: Literal["rig"]
    model: str
    bodies: dict[str, Body] = Field(default_factory=dict)
    inputs: dict[str, Input] = Field(min_length=1)
    joints: dict[str, Joint] = Field(min_length=1)
    terms: dict[str, dict[str, dict[str, Number]]] = Field(default_factory=dict)
    extension: Extension | None = None


@dataclass(frozen=True)
class RigNumber:
    """One number of a rig: SI, or what is made of the input's unit."""

    value: float
    unit: str
    tolerance: float  # one standard deviation of what the maker does not know; 0: known
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Rig:
    """A rig's file, checked.

    numbers: by key, all that can be turned: `bodies.<body>.mass`, `bodies.<body>.centre.<0..2>`,
    `bodies.<body>.inertia.<0..2>`, `inputs.<input>.torque.<joint>`, `terms.<term>.<joint or input>.<name>`; terms that
    the file does not name stand there with the values that do nothing.
    """

    name: str
    path: Path
    document: Mapping[str, Any]  # as written
    model: mujoco.MjModel  # as the file has it, nothing of numbers put in
    joints: tuple[str, ...]  # in the order of the MJCF's coordinates
    inputs: tuple[str, ...]
    units: Mapping[str, str]  # of the inputs
    noise: Mapping[str, float]  # [rad] by joint
    numbers: Mapping[str, RigNumber]

    def values(self, changes: Mapping[str, float] | None = None) -> dict[str, float]:
        """All numbers, with some changed; KeyError for one that is none."""
        found = {key: number.value for key, number in self.numbers.items()}
        for key, value in (changes or {}).items():
            if key not in found:
                raise KeyError(key)
            found[key] = value
        return found

    def changed(self, changes: Mapping[str, float]) -> "Rig":
        """The same rig with other numbers."""
        values = self.values(changes)
        return replace(self, numbers={key: replace(number, value=values[key]) for key, number in self.numbers.items()})


def load_rig(name: str | Path, overrides: Mapping[str, Any] | None = None) -> Rig:
    """The rig of that name or file, with `overrides` by dotted key; UserError for any fault."""
    path = find(name)
    document = toml_file.read(path)
    for key, value in (overrides or {}).items():
        toml_file.assign(document, key, value)
    if document.get("kind") != "rig":
        raise UserError(f"{path}: kind: found {document.get('kind')!r}; 'rig' would be right")
    file = toml_file.validate(document, RigFile, path)
    reader = Reader(path)
    mjcf = path.parent / file.model
    if not mjcf.is_file():
        mjcf = assets.path("vehicles", file.model)
    if not mjcf.is_file():
        reader.fail("model", f"no file {file.model!r} beside it or among the project's vehicles")
    model = _compiled(mjcf, reader)
    joints = tuple(model.joint(i).name for i in range(model.njnt))
    for joint in joints:
        if joint not in file.joints:
            reader.fail("joints", f"lacks {joint!r}, a joint of {file.model}")
    _known(reader, "joints", file.joints, joints)
    _known(reader, "bodies", file.bodies, [model.body(i).name for i in range(1, model.nbody)])
    return Rig(
        name=path.stem,
        path=path,
        document=document,
        model=model,
        joints=joints,
        inputs=tuple(file.inputs),
        units={name: given.unit for name, given in file.inputs.items()},
        noise={
            name: reader.scalar(given.noise, "rad", f"joints.{name}.noise", positive=True)
            for name, given in file.joints.items()
        },
        numbers={**_of_bodies(reader, file, model), **_of_inputs(reader, file, joints), **_of_terms(reader, file)},
    )


def _compiled(path: Path, reader: Reader) -> mujoco.MjModel:
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        reader.fail("model", f"{path.name}: {' '.join(str(error).split())}")
    if not model.njnt or any(kind != mujoco.mjtJoint.mjJNT_HINGE for kind in model.jnt_type):
        reader.fail("model", f"{path.name}: a rig has hinges and no other joints")
    if any(not model.joint(i).name for i in range(model.njnt)):
        reader.fail("model", f"{path.name}: every joint needs a name")
    return model


def _known(reader: Reader, section: str, given: Mapping[str, Any], names: Any) -> None:
    for name in given:
        if name not in names:
            reader.fail(f"{section}.{name}", f"unknown; {toml_file.nearest(name, list(names))}")


def _number(reader: Reader, number: Number, unit: str, key: str, low: float, high: float) -> RigNumber:
    value = reader.scalar(number, unit, key)
    if not low <= value <= high:
        reader.fail(key, f"must lie in {low:g} .. {high:g} {unit} (got {value:g})")
    # a tolerance is a difference: what an offset unit has for zero is taken off
    zero = reader.scalar(number.model_copy(update={"value": 0.0}), unit, key)
    spread = number.tolerance if isinstance(number.tolerance, float | int) else 0.0
    tolerance = reader.scalar(number.model_copy(update={"value": float(spread)}), unit, key) - zero
    return RigNumber(value, unit, tolerance, low, high)


def _vector(reader: Reader, number: Number, unit: str, key: str, low: float) -> dict[str, RigNumber]:
    values = reader.vector(number, unit, key, positive=low >= 0.0)
    given = number.tolerance if isinstance(number.tolerance, list) else [number.tolerance] * 3
    if len(given) != 3:
        reader.fail(f"{key}.tolerance", f"must be one number or 3 (got {given})")
    spread = reader.vector(number.model_copy(update={"value": [float(v) for v in given]}), unit, key)
    return {
        # inertias stay above nothing; a centre of mass may lie on either side
        f"{key}.{i}": RigNumber(
            float(values[i]), unit, float(spread[i]), max(low, 0.01 * float(values[i])) if low >= 0.0 else low, 1e3
        )
        for i in range(3)
    }


def _of_bodies(reader: Reader, file: RigFile, model: mujoco.MjModel) -> dict[str, RigNumber]:
    found: dict[str, RigNumber] = {}
    for name, body in file.bodies.items():
        key = f"bodies.{name}"
        if body.mass is not None:
            found[f"{key}.mass"] = _number(reader, body.mass, "kg", f"{key}.mass", 1e-9, 1e6)
        if body.centre is not None:
            found |= _vector(reader, body.centre, "m", f"{key}.centre", -1e3)
        if body.inertia is not None:
            if not np.allclose(model.body(name).iquat, [1.0, 0.0, 0.0, 0.0]):
                reader.fail(f"{key}.inertia", f"the principal axes of {name!r} in {file.model} are not its own axes")
            reader.inertia(body.inertia, f"{key}.inertia")
            found |= _vector(reader, body.inertia, "kg m^2", f"{key}.inertia", 0.0)
    return found


def _of_inputs(reader: Reader, file: RigFile, joints: tuple[str, ...]) -> dict[str, RigNumber]:
    found = {}
    for name, given in file.inputs.items():
        _known(reader, f"inputs.{name}.torque", given.torque, joints)
        for joint, number in given.torque.items():
            key = f"inputs.{name}.torque.{joint}"
            found[key] = _number(reader, number, f"N m/{given.unit}", key, -1e6, 1e6)
    return found


def _of_terms(reader: Reader, file: RigFile) -> dict[str, RigNumber]:
    _known(reader, "terms", file.terms, TERMS)
    found = {}
    for term in TERMS.values():
        owners = list(file.joints if term.owner == "joint" else file.inputs)
        given = file.terms.get(term.name, {})
        _known(reader, f"terms.{term.name}", given, owners)
        for owner in owners:
            numbers = given.get(owner, {})
            _known(reader, f"terms.{term.name}.{owner}", numbers, [p.name for p in term.parameters])
            for p in term.parameters:
                key = f"terms.{term.name}.{owner}.{p.name}"
                unit = file.inputs[owner].unit if p.name == "deadband" else p.unit
                assert p.default is not None
                found[key] = (
                    _number(reader, numbers[p.name], unit, key, p.low, p.high) if p.name in numbers
                    else RigNumber(p.default, unit, 0.0, p.low, p.high)
                )  # fmt: skip
    return found
