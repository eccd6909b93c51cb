"""The laboratory helicopter: fitted on the first part of its log, judged on the rest, at several places of the split.

python benchmarks/lab_helicopter.py LOG.csv [--splits 45 65.5 85] [-o DIR]

Mechanistic: the paper's model, its parameters fitted anew. Nested: structure of yaw, length of the fitted runs and
what a good model may be off chosen by cross-validation on the rows before the split, which alone were seen.
Everything: all of these structures at once, held back by their priors; only how hard to fit is chosen. By hand: dry
friction, a late yaw motor, a stiffening cable and a pitch motor whose torque grows by a power of the voltage, chosen
with the whole log in sight; each of them is also left out by itself (`--ablate`).
Free runs of 10 s, one every 2.5 s, on what was not fitted; intervals by a bootstrap of blocks of 10 s.
"""

import json
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from joblib import Parallel, delayed
from numpy.typing import NDArray

from flightlog.readers import read_log
from helideck.estimation import find_mapping
from identification.course import Course, courses
from identification.free_run import Runs, rig_runs
from identification.inner_choice import Hardness, Inner, Options, Structure
from identification.one_joint import OneJoint
from identification.rig_fit import Free, RigFit, Weighing, fit_rig
from sim.rig import Rig, load_rig

Floats = NDArray[np.float64]

DRAG, CABLE, LAG = "terms.joint_friction.yaw", "terms.joint_stiffness.yaw", "terms.actuator_lag.yaw_motor"
POWER = {"terms.input_nonlinearity.pitch_motor.exponent": 1.5}  # between a torque by voltage and one by its square
MECHANISTIC = (
    Free("inputs.pitch_motor.torque.pitch", 0.055, 1.0, True),
    Free("inputs.pitch_motor.torque.yaw", 0.15, 1.5, True),
    Free("inputs.yaw_motor.torque.pitch", -0.005, 1.0, True),
    Free("inputs.yaw_motor.torque.yaw", -0.20, 1.5, True),
    Free("terms.joint_friction.pitch.viscous", 0.01, 0.7, True),
    Free("terms.joint_friction.yaw.viscous", 0.08, 0.7, True),
    Free("bodies.beam.centre.0", 0.015, 0.01),
    Free("bodies.beam.centre.2", 0.0, 0.005),
)
# weakly known beforehand: a motor with propeller takes some tenths of a second; the cable is slack within the range
FOUND = {
    "friction": (Free(f"{DRAG}.coulomb", 0.03, 1.5, True),),
    "cable": (Free(f"{CABLE}.cubic", 0.005, 1.0, True), Free(f"{CABLE}.centre", 1.5, 0.5)),
    "late motor": (Free(f"{LAG}.tau", 0.3, 0.3, True), Free(f"{LAG}.delay", 0.15, 0.5, True)),
    "power": (),
}
# what is asked of the rows before a split: what is free of yaw, group by group; first guess: the fullest that is usual
DRY, STICKING = Free(f"{DRAG}.coulomb", 0.03, 1.5, True), Free(f"{DRAG}.stiction", 0.01, 1.0, True)
TAU, DELAY = Free(f"{LAG}.tau", 0.3, 0.5, True), Free(f"{LAG}.delay", 0.15, 0.5, True)
CENTRE = Free(f"{CABLE}.centre", 1.5, 0.5)
PITCH = tuple(f for f in MECHANISTIC if f.key.endswith((".pitch", ".pitch.viscous")) or "bodies" in f.key)
# a propeller's torque grows by the square of its speed, and that slower than the voltage
YAW = (*(f for f in MECHANISTIC if f not in PITCH), Free("terms.input_nonlinearity.pitch_motor.exponent", 1.5, 0.3))
GROUPS: Options = {
    "friction": {"viscous": (), "dry": (DRY,), "sticking": (DRY, STICKING)},
    "late": {"prompt": (), "lag": (TAU,), "lag, delay": (TAU, DELAY)},
    "cable": {
        "no cable": (), "linear cable": (Free(f"{CABLE}.stiffness", 0.01, 1.0, True), CENTRE),
        "cubic cable": (Free(f"{CABLE}.cubic", 0.005, 1.0, True), CENTRE),
    },
    "air": {"linear": (), "square": (Free(f"{DRAG}.quadratic", 0.02, 1.0, True),)},
    "input": {"power": (), "deadband": (Free("terms.input_nonlinearity.yaw_motor.deadband", 0.1, 1.0, True),)},
}  # fmt: skip
FIRST_GUESS = {"friction": "dry", "late": "lag, delay", "cable": "cubic cable", "air": "linear", "input": "power"}
EVERYTHING = {
    "friction": "sticking", "late": "lag, delay", "cable": "cubic cable", "air": "square", "input": "deadband",
}  # fmt: skip
FIRST_HARDNESS, OF_PITCH = Hardness(2.5, 0.2), Hardness(2.5, 0.1)
HARDNESSES = tuple(Hardness(horizon, spread) for spread in (0.4, 0.2, 0.1) for horizon in (2.5, 5.0))
BEST_LINEAR = Weighing(20.0, 2.5, 0.05)  # runs of 20 s give the mechanistic model its best held-out figures
SHORT = Weighing(2.5, 1.25, {"yaw": 0.2, "pitch": 0.1})


@dataclass(frozen=True)
class Held:
    """Free runs on what was not fitted."""

    yaw: float
    yaw_ci95: tuple[float, float]
    pitch: float
    yaw_fitted: float  # on what was
    values: dict[str, tuple[float, float]] = field(default_factory=dict)  # with one standard deviation
    how: str = ""  # was chosen


def rms(errors: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def interval(errors: Floats, seed: int = 0) -> tuple[float, float]:
    """95 % of the root mean square of runs (K, T), neighbours drawn together in blocks of four."""
    rng, k = np.random.default_rng(seed), len(errors)
    square = np.mean(errors**2, axis=1)
    first = rng.integers(0, max(1, k - 3), (2000, math.ceil(k / 4)))
    drawn = (first[..., None] + np.arange(4)).reshape(2000, -1)[:, :k] % k
    low, high = np.percentile(np.sqrt(square[drawn].mean(axis=1)), [2.5, 97.5])
    return float(low), float(high)


def judge(rig: Rig, fit: RigFit | None, fixed: dict[str, float], parts: tuple[Course, Course]) -> tuple[Held, Runs]:
    """Free runs with a fit, on both parts."""
    values = (dict(fit.values) if fit else {}) | fixed
    first, rest = (rig_runs(rig, part, 10.0, 2.5, values) for part in parts)
    yaw, pitch = rig.joints.index("yaw"), rig.joints.index("pitch")
    told = {} if fit is None else {key: (value, fit.std[key]) for key, value in fit.values.items()}
    return Held(
        rms(rest.errors[..., yaw]), interval(rest.errors[..., yaw]), rms(rest.errors[..., pitch]),
        rms(first.errors[..., yaw]), told,
    ), rest  # fmt: skip


def nested(rig: Rig, seen: Course, choosing: bool) -> tuple[dict[str, float], str]:
    """Values and choice of a model of yaw and pitch that knows of nothing but `seen`.

    Choosing: structure and hardness; else everything is in, and only the hardness is chosen.
    """
    yaw = Inner(OneJoint(rig, seen, "yaw"), YAW, GROUPS)
    structure: Structure = EVERYTHING
    if choosing:
        choice = yaw.choose(FIRST_GUESS, FIRST_HARDNESS, HARDNESSES)
        structure = choice.structure
    hardness = yaw.hardened(structure, HARDNESSES)
    values = yaw.fit(structure, hardness)
    kept = {key: value for key, value in values.items() if "exponent" in key}
    values |= Inner(OneJoint(rig.changed(kept), seen, "pitch"), PITCH, {}).fit({}, OF_PITCH)
    error = math.sqrt(float(yaw.errors(structure, hardness).mean()))
    how = f"{', '.join(structure.values())}; runs of {hardness.horizon:g} s, {hardness.spread:g} rad"
    return values, f"{how}; inner {error:.3f} rad"


def at(rig: Rig, course: Course, split: float, ablate: bool) -> tuple[dict[str, Held], dict[str, Runs]]:
    """Every model, fitted before `split` [s] and judged after it."""
    parts = course.part(-math.inf, split), course.part(split, math.inf)
    found: dict[str, tuple[Held, Runs]] = {"nominal": judge(rig, None, {}, parts)}
    found["mechanistic"] = judge(rig, fit_rig(rig, parts[:1], MECHANISTIC, BEST_LINEAR), {}, parts)
    for name, choosing in (("nested", True), ("everything", False)):
        values, how = nested(rig, parts[0], choosing)
        item, runs = judge(rig, None, values, parts)
        found[name] = replace(item, values={key: (value, math.nan) for key, value in values.items()}, how=how), runs
    for left_out in ("", *(FOUND if ablate else ())):
        free = (*MECHANISTIC, *(f for name, own in FOUND.items() if name != left_out for f in own))
        fixed = {} if left_out == "power" else POWER
        name = f"without {left_out}" if left_out else "by hand"
        found[name] = judge(rig, fit_rig(rig, parts[:1], free, SHORT, fixed), fixed, parts)
    held = found["nominal"][1].held[..., rig.joints.index("yaw")]
    pitch = rms(found["nominal"][1].held[..., rig.joints.index("pitch")])
    answer = {name: item for name, (item, _) in found.items()}
    answer["hold last"] = Held(rms(held), interval(held), pitch, math.nan)
    return answer, {name: runs for name, (_, runs) in found.items()}


def draw(path: Path, rig: Rig, course: Course, split: float, runs: dict[str, Runs]) -> None:
    """Measured yaw and the free runs of both models on what was not fitted."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    yaw = rig.joints.index("yaw")
    rest = course.part(split, math.inf)
    figure, axes = plt.subplots(2, 1, figsize=(11, 6), sharex=True, sharey=True, constrained_layout=True)
    for axis, name in zip(axes, ("mechanistic", "nested"), strict=True):
        axis.plot(rest.t, rest.angles[:, yaw], color="black", linewidth=2, label="measured")
        for row, predicted in zip(runs[name].rows, runs[name].predicted, strict=True):
            axis.plot(rest.t[row] + rest.dt * np.arange(len(predicted)), predicted[:, yaw], color="C3", linewidth=0.8)
        axis.set_title(f"{name}, fitted before {split:g} s: free runs of 10 s", loc="left")
        axis.set_ylabel("yaw [rad]")
        axis.set_ylim(rest.angles[:, yaw].min() - 0.7, rest.angles[:, yaw].max() + 0.7)
    axes[1].set_xlabel("time [s]")
    figure.savefig(path, dpi=90)
    plt.close(figure)


def main(
    log: tyro.conf.Positional[Path],
    splits: tuple[float, ...] = (45.0, 55.0, 65.5, 75.0, 85.0, 95.0),
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("lab_helicopter"),
    ablate: bool = False,
    workers: int = 2,
) -> None:
    """Fit and judge at every split; goes on where it was broken off."""
    output.mkdir(parents=True, exist_ok=True)
    missing = [split for split in splits if not (output / f"{split:g}.json").exists()]
    Parallel(n_jobs=workers)(delayed(_one)(log, split, output, ablate) for split in missing)
    for split in splits:
        for name, item in json.loads((output / f"{split:g}.json").read_text()).items():
            low, high = item["yaw_ci95"]
            print(f"{split:6.1f} s  {name:18s} yaw {item['yaw']:.3f} [{low:.3f}, {high:.3f}]  pitch {item['pitch']:.3f}"
                  f"  yaw fitted {item['yaw_fitted']:.3f}  {item['how']}", flush=True)  # fmt: skip


def _one(log: Path, split: float, output: Path, ablate: bool) -> None:
    """One split, written to its file."""
    rig = load_rig("lab_helicopter")
    (course,) = courses(log.name, read_log(log, find_mapping(Path("lab_helicopter"))).tables, rig)
    found, runs = at(rig, course, split, ablate)
    draw(output / f"{split:g}.png", rig, course, split, runs)
    (output / f"{split:g}.json").write_text(json.dumps({name: vars(item) for name, item in found.items()}, indent=2))


if __name__ == "__main__":
    tyro.cli(main)
