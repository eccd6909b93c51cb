"""Wu 2019 flown as it may be read: roll and pitch zero or by the attitude, equation 12 printed or corrected."""

import tempfile
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from estimators.eyes import Eyes
from estimators.navigators import Navigator
from estimators.wu_ekf import Reading
from estimators.wu_navigator import WuNavigator
from flightlog.equipment import Equipment
from flightlog.readers.folder import read_flight
from scenarios.experiments.contract import Effort, Figure, Floats, Job, Outcome, Plot, Series
from scenarios.flight import fly
from scenarios.load import build
from scenarios.schema import Scenario

NAME = "readings"
SYSTEM = "wu2019"
TITLE = "Roll and pitch taken for zero, and equation 12 as printed, in closed loop"
ABOUT = (
    "Section 3.1 takes roll and pitch for zero where it turns a picture into a position, and equation 12 leaves the "
    "acceleration and F P F' out of the filter. Each reading holds a hover over the landmark for half a minute, on the "
    "pad camera's error model, in default weather: errors of the estimate in position, from 8 s on, and how far the "
    "helicopter strays from its point."
)

HEIGHTS = (3.0, 5.0, 10.0)  # [m]
SECONDS = {"full": 40.0, "quick": 24.0}
SETTLED = 8.0  # [s]
SEED = 4


class Held(NamedTuple):
    """One hover; times (N,) [s], errors and places (N, 3) [m] ENU, place from the point to be held."""

    height: float
    exact: bool
    reading: Reading
    t: Floats
    errors: Floats
    strayed: Floats


def hold(height: float, exact: bool, reading: Reading, seconds: float) -> Held:
    """Fly one reading."""

    def navigator(equipment: Equipment, scenario: Scenario, sees: bool) -> Navigator:
        return WuNavigator(equipment, Eyes(), exact=exact, reading=reading)

    scenario = build(
        pad="ring", duration_s=seconds, start={"position_m": [0.3, -0.3, height]},
        plan={"goal": "hover", "point_m": [0.0, 0.0, height]},
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        fly(scenario, seed=SEED, cameras=False, folder=f"{folder}/flight", navigator=navigator)
        log = read_flight(f"{folder}/flight")
        state, estimate = log.truth["state"], log.measured["estimate"]
        t = estimate["t"][estimate["t"] > SETTLED]
        true = np.column_stack([np.interp(t, state["t"], state[name]) for name in "enu"])
        found = np.column_stack([estimate[name][estimate["t"] > SETTLED] for name in "enu"])
    return Held(height, exact, reading, t, found - true, true - [0.0, 0.0, height])


def jobs(effort: Effort) -> Sequence[Job]:
    """A hover each."""
    seconds = SECONDS[effort]
    wanted: list[tuple[float, bool, Reading]] = [
        (height, exact, "corrected") for height in HEIGHTS for exact in (False, True)
    ]
    wanted += [(5.0, True, "mixed"), (5.0, True, "printed")]
    return [Job(hold, (*item, seconds), f"hover at {item[0]:g} m", 0.05 * seconds) for item in wanted]


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """Errors by reading and height."""
    flights: list[Held] = list(answers)
    rows = [
        {
            "height [m]": item.height, "roll and pitch": "by attitude" if item.exact else "zero",
            "equation 12": item.reading,
            "X, Y error RMS [m]": float(np.sqrt(np.mean(item.errors[:, :2] ** 2))),
            "X, Y error largest [m]": float(np.abs(item.errors[:, :2]).max()),
            "Z error largest [m]": float(np.abs(item.errors[:, 2]).max()),
            "strayed largest [m]": float(np.linalg.norm(item.strayed[:, :2], axis=1).max()),
        }
        for item in flights
    ]  # fmt: skip
    figures = []
    for height in HEIGHTS:
        level, exact = (
            next(i for i in flights if (i.height, i.exact, i.reading) == (height, how, "corrected"))
            for how in (False, True)
        )
        figures.append(Figure(
            f"hover at {height:g} m: X, Y, largest error, roll and pitch zero | by attitude", "m", 0.1,
            float(np.abs(level.errors[:, :2]).max()), float(np.abs(exact.errors[:, :2]).max()), bar=0.1,
            note="the paper's own figure needs the attitude",
        ))  # fmt: skip
    lines = [
        Series("zero" if not item.exact else "by attitude", item.t, item.strayed[:, 0])
        for item in flights if item.height == 5.0 and item.reading == "corrected"
    ]  # fmt: skip
    return Outcome(
        figures,
        plots=[Plot("East of the point to be held, 5 m up",
                    "With roll and pitch taken for zero every correction moves the landmark in the picture.",
                    "time [s]", "east [m]", lines)],
        tables=[("Hovers", rows)],
        notes=["Sightings are those of the pad camera's error model: no error of Harris' corners is in them."],
    )  # fmt: skip
