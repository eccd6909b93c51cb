"""Finds what drove the physics out of the numbers: runs the model's last instants again, term by term."""

import math

import numpy as np
from numpy.typing import NDArray

from flightlog.signals import Controls
from sim.motion import sense_motion
from sim.pipeline import Pipeline
from sim.schedule import TICK
from sim.terms.contract import SIGNALS

Floats = NDArray[np.float64]

INSTANTS = 5  # ticks that are run again
HUGE_FORCE = 1e4  # [N] two hundred times the weight of a machine of this class
HUGE_MOMENT = 1e3  # [N m]


class SimulationDiverged(RuntimeError):
    """The physics left the numbers; says when, in what state, and the likely cause."""


def suspect(
    pipeline: Pipeline,
    signals: np.void,
    state: Floats,
    qpos: Floats,
    qvel: Floats,
    wind: Floats,
    surface: tuple[float, float],
    controls: Controls,
) -> str:
    """The likely cause, in words.

    signals, state: the pipeline's, last sound ones; qpos (7,), qvel (6,): the free joint's, last sound ones; wind (3,)
    [m/s] ENU; surface: pressure [Pa] and temperature [K] at the ground; controls: as sent since.
    """
    for name, value in controls._asdict().items():
        if not math.isfinite(value):
            return f"control {name!r}, which the pilot sent as {value}"
    if not np.isfinite(wind).all():
        return f"the wind, which is {wind.tolist()} m/s"
    s, x, v = signals.copy(), state.copy(), pipeline.geometry
    largest, culprit = 0.0, ""
    for _ in range(INSTANTS):
        sense_motion(s, qpos, qvel, wind, *surface)
        s["time"] += TICK
        s["collective"], s["lateral"], s["longitudinal"], s["tail"], s["throttle"] = controls
        s["ground"], s["mass"] = 1.0, v["mass"]
        s["force"][:] = s["moment"][:] = 0.0
        for term, (first, last, low, high) in zip(pipeline.terms, pipeline.spans, strict=True):
            force, moment = s["force"].copy(), s["moment"].copy()
            term.kernel(s, v, x[first:last], pipeline.parameters[low:high], TICK)
            for name, value in zip(term.states, x[first:last], strict=True):
                if not math.isfinite(value):
                    return f"term {term.name!r}, whose state {name!r} is {value}"
            for name in SIGNALS.names or ():
                if not np.isfinite(s[name]).all():
                    return f"term {term.name!r}, which makes {name!r} {np.ravel(s[name]).tolist()}"
            size = max(
                float(np.abs(s["force"] - force).max()) / HUGE_FORCE,
                float(np.abs(s["moment"] - moment).max()) / HUGE_MOMENT,
            )
            if size > largest:
                largest = size
                culprit = f"term {term.name!r}, whose force is {(s['force'] - force).round().tolist()} N"
    if largest > 1.0:
        return culprit
    return "motion too fast for the physics' step: check masses, inertias and gains"
