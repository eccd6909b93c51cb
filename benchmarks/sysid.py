"""A fit of all parameters by `mujoco.sysid` beside ours: the laboratory helicopter's log, and one whose cause is known.

python benchmarks/sysid.py [LOG.csv] [--split 65.5]

`mujoco.sysid` fits what an MJCF has (gears of the motors, damping, dry friction, springs, the centre of mass) to the
same rows from the nominal file; it asks nothing about structure. Without a log only the second part runs: a log of the
same rig whose yaw motor is late, which no number of the MJCF is; both fits, and what `helideck diagnose` says.
"""

import os
import time
from functools import partial
from pathlib import Path
from typing import Annotated, Any

os.environ.setdefault("MUJOCO_GL", "disable")  # its report module would look for a screen

import mujoco as untyped
import numpy as np
import pyarrow as pa
import tyro
from mujoco import sysid as untyped_sysid
from numpy.typing import NDArray

import assets
from flightlog.readers import read_log
from flightlog.tables import Table
from flightlog.topics import topic_of
from helideck.estimation import find_mapping
from identification.course import Course, causal_states, courses
from identification.diagnosis import examine
from identification.free_run import SPAN, rig_runs, starts
from sim.rig import Rig, load_rig
from sim.rig_motion import Moving

Floats = NDArray[np.float64]
mujoco: Any = untyped  # neither of them is typed as far as used here
sysid: Any = untyped_sysid

STRETCH = 10.0  # [s] of each fitted run; shorter ones tell friction from damping worse
ZERO = {"viscous": 0.2, "coulomb": 0.2, "stiffness": 0.2}  # how far a number of a joint may go, from nothing
TRUTH = {  # a rig that moves, sticks and does not go over the top
    "inputs.pitch_motor.torque.pitch": 0.041, "inputs.pitch_motor.torque.yaw": 0.107,
    "inputs.yaw_motor.torque.pitch": -0.0028, "inputs.yaw_motor.torque.yaw": -0.137,
    "terms.joint_friction.pitch.viscous": 0.029, "terms.joint_friction.yaw.viscous": 0.028,
    "terms.joint_friction.yaw.coulomb": 0.03, "bodies.beam.centre.0": 0.015, "bodies.beam.centre.2": -0.0014,
}  # fmt: skip
HIDDEN = {"terms.actuator_lag.yaw_motor.tau": 0.3}


def parameters(rig: Rig) -> dict[str, tuple[float, float, float]]:
    """By key of the rig: nominal, least and greatest, for all that the MJCF has a place for."""
    found = {}
    for key, number in rig.numbers.items():
        if ".torque." in key:
            far = 5.0 * number.value
            found[key] = (number.value, min(0.0, far), max(0.0, far))
        elif key.startswith("bodies.") and ".centre." in key and number.tolerance > 0.0:
            found[key] = (number.value, number.value - 5.0 * number.tolerance, number.value + 5.0 * number.tolerance)
        elif key.rpartition(".")[2] in ZERO:
            found[key] = (max(number.value, 1e-3), 0.0, ZERO[key.rpartition(".")[2]])
    return found


def specification(rig: Rig) -> Any:
    """The rig's MJCF with a motor for each input and joint, and its angles as sensors."""
    beside = rig.path.parent / str(rig.document["model"])
    path = beside if beside.is_file() else assets.path("vehicles", str(rig.document["model"]))
    spec = mujoco.MjSpec.from_file(str(path))
    spec.option.timestep = 0.01
    for key in rig.numbers:
        if ".torque." in key:
            _, name, _, joint = key.split(".")
            motor = spec.add_actuator(name=f"{name}.{joint}", target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            motor.set_to_motor()
    for joint in rig.joints:
        spec.add_sensor(
            name=joint, type=mujoco.mjtSensor.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=joint
        )
    for key, (value, _, _) in parameters(rig).items():
        place(spec, key, value)
    return spec


def place(spec: Any, key: str, value: float) -> None:
    """A number of the rig where the MJCF has it."""
    section, name, *rest = key.split(".")
    if section == "inputs":
        spec.actuator(f"{name}.{rest[1]}").gear[0] = value
    elif section == "bodies":
        spec.body(name).ipos[int(rest[1])] = value
    else:
        joint = spec.joint(rest[0])
        if rest[1] == "viscous":
            joint.damping = np.array([value, 0.0, 0.0]) if np.ndim(joint.damping) else value
        elif rest[1] == "coulomb":
            joint.frictionloss = value
        else:
            joint.stiffness = np.array([value, 0.0, 0.0]) if np.ndim(joint.stiffness) else value


def _modify(key: str, spec: Any, parameter: Any) -> None:
    place(spec, key, float(parameter.value[0]))


def fit(rig: Rig, course: Course) -> tuple[dict[str, float], dict[str, float]]:
    """Values and half widths of the 95 % intervals, as `mujoco.sysid` gives them."""
    numbers = sysid.ParameterDict()
    for key, (value, low, high) in parameters(rig).items():
        numbers.add(sysid.Parameter(key, value, low, high, modifier=partial(_modify, key)))
    spec = specification(rig)
    model = spec.compile()
    rows, length = starts(course, STRETCH, STRETCH)
    states = causal_states(course, SPAN)
    drive = [rig.inputs.index(model.actuator(i).name.split(".")[0]) for i in range(model.nu)]
    n, t = len(rig.joints), course.dt * np.arange(length)
    sequences = sysid.ModelSequences(
        "rig", spec, [f"from {row}" for row in rows],
        [sysid.create_initial_state(model, states[row, :n], states[row, n:]) for row in rows],
        [sysid.TimeSeries(t, course.inputs[row : row + length][:, drive]) for row in rows],
        [
            sysid.TimeSeries(t, course.angles[row : row + length], sysid.TimeSeries.compute_all_sensor_mapping(model))
            for row in rows
        ],
    )  # fmt: skip
    residual = sysid.build_residual_fn(models_sequences=[sequences])
    best, result = sysid.optimize(numbers, residual, optimizer="scipy", verbose=False)
    left, _, _ = residual(best.as_vector(), best)
    _, wide = sysid.calculate_intervals(left, result.jac)
    values = {key: float(best[key].value[0]) for key in parameters(rig)}
    return values, dict(zip(values, np.abs(np.asarray(wide)).ravel().tolist(), strict=True))


def error(rig: Rig, course: Course, changes: dict[str, float]) -> dict[str, float]:
    """Root mean square [rad] of free runs of 10 s, by joint."""
    errors = rig_runs(rig, course, 10.0, 2.5, changes).errors
    return {joint: float(np.sqrt(np.mean(errors[..., i] ** 2))) for i, joint in enumerate(rig.joints)}


def made(rig: Rig, changes: dict[str, float], seconds: float, seed: int) -> dict[str, Table]:
    """A log of the rig with other numbers: steps of both motors, noise of the angles."""
    rng, dt = np.random.default_rng(seed), 0.01
    t = np.asarray(dt * np.arange(round(seconds / dt)), np.float64)
    steps = np.arange(0.0, seconds, 2.0)
    u = np.column_stack([
        rng.choice([1.30, 1.36, 1.42], len(steps)), rng.choice([0.5, 0.75, 1.0, 1.25, 1.5], len(steps)),
    ])[np.searchsorted(steps, t, side="right") - 1]  # fmt: skip
    moving = Moving(rig, dt, changes)
    angles = moving.run(np.array([[1.4, -0.45, 0.0, 0.0]]), moving.torques(u)[None])[0, :, :2]
    angles = angles + rng.normal(0.0, [rig.noise[joint] for joint in rig.joints], (len(t), 2))
    columns = {"joints": dict(zip(rig.joints, angles.T, strict=True)),
               "controls": dict(zip(rig.inputs, u.T, strict=True))}  # fmt: skip
    return {
        name: Table(name, pa.table({"t": t} | given), topic_of("measured", name)) for name, given in columns.items()
    }


def main(
    log: Annotated[Path | None, tyro.conf.Positional] = None, split: float = 65.5, seconds: float = 60.0, seed: int = 0
) -> None:
    """Both parts; the first only with a log."""
    rig = load_rig("lab_helicopter")
    if log is not None:
        (course,) = courses(log.name, read_log(log, find_mapping(Path("lab_helicopter"))).tables, rig)
        begun = time.perf_counter()
        values, wide = fit(rig, course.part(-np.inf, split))
        tell(f"measured log, fitted before {split:g} s ({time.perf_counter() - begun:.0f} s)", rig, values, wide, {})
        print("  held out [rad]:", {k: round(v, 3) for k, v in error(rig, course.part(split, np.inf), values).items()})
    base = rig.changed(TRUTH)
    tables = [made(base, HIDDEN, seconds, seed + i) for i in range(2)]
    first, other = (courses("made", table, base)[0] for table in tables)
    begun = time.perf_counter()
    values, wide = fit(base, first)
    tell(f"late yaw motor ({time.perf_counter() - begun:.0f} s)", base, values, wide, TRUTH)
    found = examine({"made": tables[0]}, base)
    ours = dict(found.search.fit(found.causes).values)
    print("ours:", ", ".join(f"{c.name} {c.probability:.2f}" for c in found.verdict.causes) or "nothing", ours)
    for name, changes in (("nominal", {}), ("mujoco.sysid", values), ("ours", ours), ("truth", HIDDEN)):
        print(f"  held out [rad], {name}:", {k: round(v, 4) for k, v in error(base, other, changes).items()})


def tell(title: str, rig: Rig, values: dict[str, float], wide: dict[str, float], truth: dict[str, float]) -> None:
    """What was fitted, and by how many of its standard deviations it misses."""
    print(f"mujoco.sysid, {title}")
    for key, value in values.items():
        off = f"  off by {abs(value - truth.get(key, 0.0)) / max(wide[key] / 1.96, 1e-12):.0f} sigma" if truth else ""
        print(f"  {key:42s} {value:9.4f} +- {wide[key]:.4f} (95 %), nominal {rig.numbers[key].value:.4f}{off}")


if __name__ == "__main__":
    tyro.cli(main)
