"""A fit of all parameters by `mujoco.sysid` beside ours: flights of a helicopter with one thing wrong.

python -m benchmarks.sysid_helicopter [CAUSE ...] [--seed 30009] [--flights 3] [--duration 60]

Both see the same rows: innovations of every sensor and of the model's force, moment and rotor speed, whitened alike,
each flight's wind and what its sensors may be off by free. `mujoco.sysid` fits every number that any cause or tolerance
has, between bounds, and asks which are needed of none. Judged is a flight that neither has seen: what is left of the
squares there, in nats against the vehicle file as it is.
"""

import os
import time
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

os.environ.setdefault("MUJOCO_GL", "disable")  # its report module would look for a screen

import numpy as np
import tyro
from mujoco import sysid as untyped_sysid
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.blind_judge import logs
from identification.diagnosis import examine, open_bench
from identification.evidence import solve
from identification.helicopter import HelicopterBench
from sim.vehicle import load
from tests.blind.injector import make

Floats = NDArray[np.float64]
sysid: Any = untyped_sysid  # not typed as far as used here

WIDE = 5.0  # of a tolerance or of a cause's usual size, that a number may go
STEP = 0.05  # of it, by which slopes are taken
CAUSES = ("drag", "sonar_scale", "baro_lag")


def left(bench: HelicopterBench, at: Mapping[str, float]) -> list[Floats]:
    """By flight, what numbers by key leave of the rows, and of what is the flight's own its deviations."""
    found = []
    for i in range(len(bench.names)):
        rows = bench.rows(i, at)
        _, local, rest = solve(rows, {})
        found.append(np.concatenate([rest, local / rows.local_std]))
    return found


def fit(bench: HelicopterBench) -> dict[str, float]:
    """Every number of the bench as `mujoco.sysid` has it."""
    keys = sorted({*bench.tolerances, *bench.spreads})
    scale = {key: bench.tolerances.get(key, 0.0) or bench.spreads[key] for key in keys}
    keys = [key for key in keys if scale[key] > 0.0]
    numbers = sysid.ParameterDict()
    for key in keys:
        far = max(WIDE, bench.spreads.get(key, 0.0) / scale[key])
        numbers.add(sysid.Parameter(key, 0.0, -far, far))  # in tolerances from nominal

    def residual(x: Floats, _: object) -> tuple[list[Floats], None, None]:
        return left(bench, values(np.asarray(x))), None, None

    def values(x: Floats) -> dict[str, float]:
        moved = zip(keys, x.ravel().tolist(), strict=True)
        return {key: bench.bounded(key, bench.nominal[key] + scale[key] * by) for key, by in moved}

    best, _ = sysid.optimize(numbers, residual, optimizer="scipy", verbose=False, diff_step=STEP, max_iters=12)
    return values(np.asarray(best.as_vector()))


def main(
    causes: Annotated[tuple[str, ...], tyro.conf.Positional] = CAUSES, seed: int = 30009, flights: int = 3,
    duration: float = 60.0,
) -> None:  # fmt: skip
    """One set a cause; what was hidden is told after both have had their say."""
    vehicle = load("raptor90")
    table = Table("hidden", "ours says", "ours [nats]", "mujoco.sysid [nats]", "its time [s]", "beyond 3 tolerances")
    for i, cause in enumerate(causes):
        with TemporaryDirectory(prefix="sysid-") as place:
            made = make(
                seed + 100 * i, "single", Path(place) / "set", Path(place) / "answers", names=(cause,),
                flights=flights, heldout=1, duration_s=duration,
            )  # fmt: skip
            found = examine(logs(made.flights), vehicle)
            first, held = open_bench(logs(made.flights), vehicle), open_bench(logs(made.heldout), vehicle)
            assert isinstance(first, HelicopterBench) and isinstance(held, HelicopterBench)
            begun = time.perf_counter()
            theirs = fit(first)
            took = time.perf_counter() - begun
        ours = dict(found.search.fit(found.causes).at)
        nominal, mine, other = (sum(0.5 * float(r @ r) for r in left(held, at)) for at in ({}, ours, theirs))
        far = sum(abs(theirs[k] - first.nominal[k]) > 3.0 * t for k, t in first.tolerances.items() if t > 0.0)
        said = ", ".join(f"{c.name} {c.probability:.2f}" for c in found.verdict.causes) or "nothing"
        table.add_row(cause, said, f"{nominal - mine:.0f}", f"{nominal - other:.0f}", f"{took:.0f}", str(far))
    Console().print(table)


if __name__ == "__main__":
    tyro.cli(main)
