"""Rigs: the filter against the closed form, one joint against the whole mechanism, structure found without the rest."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from scipy.stats import multivariate_normal

from flightlog.tables import Table
from flightlog.topics import topic_of
from identification.course import Course
from identification.diagnosis import examine
from identification.inner_choice import Hardness, Inner
from identification.one_joint import OneJoint
from identification.rig_filter import FIRST, MEMORY, Linear, Noise, innovations
from identification.rig_fit import Free
from sim.rig import Rig, load_rig
from sim.rig_motion import Moving

ARM = """<mujoco><option integrator="implicitfast"/>
<default><geom contype="0" conaffinity="0" mass="0"/>
<joint type="hinge" axis="0 1 0" solimpfriction="0.9999 0.9999 0.001" solreffriction="0.02 1"/></default>
<worldbody><body name="upper"><inertial pos="0 0 -0.15" mass="0.8" diaginertia="0.008 0.008 0.001"/>
<joint name="shoulder"/><geom type="capsule" size="0.01" fromto="0 0 0 0 0 -0.3"/>
<body name="fore" pos="0 0 -0.3"><inertial pos="0 0 -0.12" mass="0.4" diaginertia="0.002 0.002 0.0003"/>
<joint name="elbow"/><geom type="capsule" size="0.01" fromto="0 0 0 0 0 -0.25"/></body></body></worldbody></mujoco>"""
FILE = """kind = "rig"
model = "arm.xml"
[bodies.fore]
mass = {value = 0.4, unit = "kg", tolerance = 0.01}
centre = {value = [0.0, 0.0, -0.12], unit = "m", tolerance = [0.0, 0.0, 0.003]}
[inputs.m1]
unit = "V"
torque = {shoulder = {value = 0.5, unit = "N m/V", tolerance = 0.02}}
[inputs.m2]
unit = "V"
torque = {elbow = {value = 0.2, unit = "N m/V", tolerance = 0.01}}
[joints.shoulder]
noise = {value = 0.002, unit = "rad"}
[joints.elbow]
noise = {value = 0.002, unit = "rad"}
[terms.joint_friction.shoulder]
viscous = {value = 0.1, unit = "N m s/rad", tolerance = 0.01}
[terms.joint_friction.elbow]
viscous = {value = 0.03, unit = "N m s/rad", tolerance = 0.003}
"""


@pytest.fixture
def arm(tmp_path: Path) -> Rig:
    (tmp_path / "arm.xml").write_text(ARM)
    (tmp_path / "arm.toml").write_text(FILE)
    return load_rig(tmp_path / "arm.toml")


def moved(rig: Rig, changes: dict[str, float], seconds: float, seed: int) -> Course:
    rng, dt = np.random.default_rng(seed), 0.01
    count = round(seconds / dt)
    inputs = rng.uniform(-2.0, 2.0, (count // 150 + 1, 2))[np.arange(count) // 150]
    moving = Moving(rig, dt, changes, 0.0025)
    angles = moving.run(np.zeros((1, 4)), moving.torques(inputs)[None])[0, :, :2]
    return Course("arm", 0.0, dt, inputs, angles + rng.normal(0.0, 0.002, angles.shape))


def tables(course: Course, rig: Rig) -> dict[str, Table]:
    columns = {"joints": dict(zip(rig.joints, course.angles.T, strict=True)),
               "controls": dict(zip(rig.inputs, course.inputs.T, strict=True))}  # fmt: skip
    return {
        name: Table(name, pa.table({"t": course.t} | given), topic_of("measured", name))
        for name, given in columns.items()
    }


def test_the_likelihood_of_the_innovations_is_that_of_all_measurements_at_once() -> None:
    """One joint, seven nodes: against the normal distribution of the whole vector, written out."""
    h, nodes, f = 0.05, 7, np.array([[1.0, 0.048], [-0.1, 0.9]])
    noise = Noise(np.array([0.02]), np.array([3.0]), np.array([0.4]))
    rng = np.random.default_rng(3)
    seen, defects = rng.normal(0.0, 0.05, (nodes, 1)), rng.normal(0.0, 0.01, (nodes - 1, 2, 1))
    linear = Linear(h, np.repeat(f[None], nodes - 1, axis=0), seen)
    push = 0.5 * (f[:, 1] + np.array([0.0, 1.0]))
    phi = np.exp(-h / MEMORY)
    step = np.block([[f, h * push[:, None]], [np.zeros((1, 2)), np.array([[phi]])]])
    random = np.zeros((3, 3))
    random[:2, :2], random[2, 2] = 0.16 * h * np.outer(push, push), 9.0 * (1.0 - phi**2)
    state = np.diag([(FIRST * 0.02) ** 2, 1.0, 9.0])
    mean, means = np.zeros(3), [0.0]
    states = [state]
    for d in defects[:, :, 0]:
        mean = step @ mean + np.append(d, 0.0)
        means.append(mean[0])
        states.append(step @ states[-1] @ step.T + random)
    whole = np.zeros((nodes, nodes))
    for i in range(nodes):
        for j in range(i + 1):
            whole[i, j] = whole[j, i] = (np.linalg.matrix_power(step, i - j) @ states[j])[0, 0]
    whole += 0.02**2 * np.eye(nodes)
    z, logs = _unsettled(linear, noise, defects)
    expected = multivariate_normal(means, whole).logpdf(seen[:, 0])
    assert -0.5 * (z**2).sum() - logs - 0.5 * nodes * np.log(2.0 * np.pi) == pytest.approx(expected, rel=1e-9)


def _unsettled(linear: Linear, noise: Noise, defects: np.ndarray) -> tuple[np.ndarray, float]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("identification.rig_filter.SETTLING", 0)
        return innovations(linear, noise, defects)


def test_one_joint_by_itself_moves_as_in_the_whole_mechanism(arm: Rig) -> None:
    changes = {
        "terms.joint_friction.shoulder.coulomb": 0.05, "terms.joint_friction.shoulder.quadratic": 0.05,
        "terms.joint_stiffness.shoulder.cubic": 0.3, "terms.joint_stiffness.shoulder.stiffness": 0.5,
        "terms.actuator_lag.m1.tau": 0.1, "inputs.m2.torque.elbow": 0.0, "terms.joint_friction.elbow.viscous": 1.0,
    }  # fmt: skip
    course = moved(arm, changes, 12.0, 0)
    rows = np.arange(100, 900, 100)
    alone = OneJoint(arm, course, "shoulder").run(rows, 200, changes)
    assert np.ptp(course.angles[:, 0]) > 0.5
    assert np.sqrt(np.mean((alone - OneJoint(arm, course, "shoulder").measured(rows, 200)) ** 2)) < 0.03
    without = OneJoint(arm, course, "shoulder").run(rows, 200, changes | {"terms.joint_stiffness.shoulder.cubic": 0.0})
    assert np.abs(without - alone).max() > 0.02


def test_structure_is_found_on_the_rows_that_may_be_seen(arm: Rig) -> None:
    key = "terms.joint_friction.shoulder"
    hidden = {f"{key}.coulomb": 0.2, "inputs.m2.torque.elbow": 0.0, "terms.joint_friction.elbow.viscous": 1.0}
    still = arm.changed({"inputs.m2.torque.elbow": 0.0, "terms.joint_friction.elbow.viscous": 1.0})
    inner = Inner(
        OneJoint(still, moved(arm, hidden, 40.0, 1), "shoulder"), (Free(f"{key}.viscous", 0.1, 0.3, True),),
        {
            "friction": {"viscous": (), "dry": (Free(f"{key}.coulomb", 0.1, 1.0, True),)},
            "input": {"prompt": (), "late": (Free("terms.actuator_lag.m1.tau", 0.1, 1.0, True),)},
        },
    )  # fmt: skip
    choice = inner.choose({"friction": "viscous", "input": "late"}, Hardness(2.0, 0.05), [Hardness(2.0, 0.05)])
    assert choice.structure["friction"] == "dry"
    assert inner.fit(choice.structure, choice.hardness)[f"{key}.coulomb"] == pytest.approx(0.2, rel=0.1)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"bodies.fore.centre.2": -0.123, "inputs.m1.torque.shoulder": 0.51}, []),
        ({"terms.actuator_lag.m1.delay": 0.1, "bodies.fore.mass": 0.41}, ["actuator_delay#m1"]),
    ],
    ids=["within tolerance", "late input"],
)
def test_an_arm_is_diagnosed(arm: Rig, changes: dict[str, float], named: list[str]) -> None:
    """A centre of mass below its joint stays within what is possible; a delay is not taken for a lag."""
    found = examine({"log": tables(moved(arm, changes, 16.0, 2), arm)}, arm)
    assert found.verdict.baseline.certified
    assert list(found.causes) == named
