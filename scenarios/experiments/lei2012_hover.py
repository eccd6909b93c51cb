"""Lei 2012, section 4.2: a minute of hover at 10 m, heights by each sensor alone, fused, and fused without vision."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flightlog.signals import Measurement, StateEstimate
from scenarios.experiments.contract import Effort, Figure, Floats, Job, Outcome, Plot, Series
from scenarios.flight import fly
from scenarios.load import load
from scenarios.summary import Summary
from sim.world import World

NAME = "hover"
SYSTEM = "lei2012"
TITLE = "Hover at 10 m: heights by each sensor, fused, and without vision"
ABOUT = (
    "The paper hovered at 10 m for a minute in wind below Beaufort 2 and compared barometer, differential GPS, vision "
    "and the fused height with a reference. Here the loop is closed on each navigator in turn, in 1.5 m/s of wind with "
    "Dryden turbulence. Barometer and GPS have the mean and the deviation that the paper reports of them, as a bias of "
    "either sign and a Gauss-Markov wander of 15 s. The published filter flies on vision as bad as the paper's (scale "
    "error and noise of the mark's size), and once on rendered pictures through the paper's own front end; ours on the "
    "pad camera's error model, and once rendered."
)

FLIGHTS = {"full": 16, "quick": 4}  # each pair of signs of GPS and vision
RENDERED_S = {"full": 60.0, "quick": 8.0}
COURSE_EVERY = 25  # steps of the loop

PAPER = {  # mean absolute error, standard deviation [m]
    "baro": (0.674, 0.369),
    "gps": (0.538, 0.253),
    "vision": (0.498, 0.380),
}
# what makes them: constant error [m] and wander [m] of which a minute shows 0.79
BARO, GPS = (0.64, 0.45), (0.525, 0.32)
WANDER_TAU = 15.0  # [s]
SCALE, SIZE_PX = 0.046, 1.68  # of vision: error of the scale, of half the mark's length in the picture


@dataclass(frozen=True, eq=False)
class Hovered:
    """One flight's figures and its height errors."""

    summary: Summary
    t: Floats  # (K,) [s]
    error: Floats  # (K,) [m] fused less true


def sensors_of(seed: int, poor_vision: bool) -> dict[str, float]:
    """Scenario settings that give the sensors the paper's errors; their signs are the seed's lowest bits."""
    gps, vision, baro = (1.0 if seed >> bit & 1 else -1.0 for bit in range(3))
    settings = {
        "sensors.baro.bias_m": baro * BARO[0], "sensors.baro.bias_std_m": 0.0, "sensors.baro.drift_std_m": BARO[1],
        "sensors.baro.drift_tau_s": WANDER_TAU,
        "sensors.gps.bias_u_m": gps * GPS[0], "sensors.gps.bias_std_up_m": 0.0, "sensors.gps.wander_std_up_m": GPS[1],
        "sensors.gps.wander_tau_s": WANDER_TAU,
    }  # fmt: skip
    if poor_vision:
        settings |= {
            "sensors.pad.scale": 1.0 + vision * SCALE, "sensors.pad.size_noise_px": SIZE_PX,
            "sensors.pad.size_tau_s": 0.3,
        }  # fmt: skip
    return settings


CASES: Mapping[str, Mapping[str, Any]] = {
    "published": {"navigator": "lei2012", "variant": "published"},
    "ours": {"navigator": "lei2012", "variant": "helideck"},
    "published without vision": {"navigator": "lei2012", "variant": "published", "pad": "none"},
    "ours without vision": {"navigator": "lei2012", "variant": "helideck", "pad": "none"},
}
RENDERED = ("published", "ours")


def hover(case: str, seed: int, seconds: float, rendered: bool) -> Hovered:
    """Fly one."""
    poor = case == "published" and not rendered
    settings = {**sensors_of(seed, poor), **CASES[case], "duration_s": seconds, "start.spread_m": 0.5}
    if rendered:
        settings |= {f"cameras.{name}.rate_hz": 1.0 for name in ("forward_a", "forward_b")}  # they do not matter here
    course: list[tuple[float, float]] = []
    steps = 0

    def look(world: World, measurements: Sequence[Measurement], navigator: Any, state: StateEstimate) -> None:
        nonlocal steps
        steps += 1
        if steps % COURSE_EVERY == 0 and world.truth.t > 1.0:
            course.append((world.truth.t, float(state.position[2] - world.truth.position[2])))

    flight = fly(load("hover", settings), seed=(5, seed), cameras=rendered, onlooker=look)
    rows = np.array(course)
    return Hovered(flight.summary, rows[:, 0], rows[:, 1])


def _plan(effort: Effort) -> list[tuple[str, int, float, bool]]:
    plan = [(case, seed, 60.0, False) for case in CASES for seed in range(FLIGHTS[effort])]
    return plan + [(case, 100, RENDERED_S[effort], True) for case in RENDERED]


def jobs(effort: Effort) -> Sequence[Job]:
    """One a flight."""
    return [
        Job(hover, one, f"hover, {one[0]}{', rendered' if one[3] else ''}", 1.2 * one[2] if one[3] else 3.0)
        for one in _plan(effort)
    ]


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _fused(flights: Sequence[Hovered]) -> tuple[float | None, float | None, float | None]:
    """Mean absolute error, its largest over all flights, standard deviation [m]."""
    largest = [f.summary.fused_height_max_error_m for f in flights if f.summary.fused_height_max_error_m is not None]
    return (
        _mean([f.summary.fused_height_mean_error_m for f in flights]),
        max(largest, default=None),
        _mean([f.summary.fused_height_std_m for f in flights]),
    )


def _alone(flights: Sequence[Hovered], sensor: str, statistic: str) -> float | None:
    return _mean([(f.summary.sensor_height_error_m[sensor] or {}).get(statistic) for f in flights])


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """Means over the flights, the largest of all of them."""
    flown: dict[tuple[str, bool], list[Hovered]] = {}
    for (case, _, _, rendered), answer in zip(_plan(effort), answers, strict=True):
        flown.setdefault((case, rendered), []).append(answer)
    published, ours = flown["published", False], flown["ours", False]
    figures = []
    for sensor, (mean, std) in PAPER.items():
        name = {"baro": "barometer", "gps": "GPS", "vision": "vision"}[sensor]
        for statistic, value in (("mean", mean), ("std", std)):
            figures.append(
                Figure(
                    f"{name} alone, {statistic}", "m", value, _alone(published, sensor, statistic),
                    _alone(ours, sensor, statistic), note="set to the paper's" if sensor != "vision" else
                    "faithful: set to the paper's; ours: the pad camera's error model",
                )
            )  # fmt: skip
    for (name, value, bar, expected), theirs, mine in zip(
        (
            ("mean", 0.328, 0.03, (0.25, 0.35)), ("largest", 1.30, 0.10, (0.0, 1.30)), ("std", 0.249, 0.02, None),
        ), _fused(published), _fused(ours), strict=True,
    ):  # fmt: skip
        note = "over all flights; the paper says: below 1.30" if name == "largest" else "mean over the flights"
        figures.append(Figure(f"fused, {name}", "m", value, theirs, mine, bar=bar, expected=expected, note=note))
    for name, theirs, mine in zip(
        ("mean", "largest", "std"), _fused(flown["published without vision", False]),
        _fused(flown["ours without vision", False]), strict=True,
    ):  # fmt: skip
        figures.append(Figure(f"fused without vision, {name}", "m", None, theirs, mine,
                              note="the constant errors of barometer and GPS cannot be told from height"))  # fmt: skip
    real, seen = flown["published", True], flown["ours", True]
    for name, theirs, mine in zip(("mean", "largest", "std"), _fused(real), _fused(seen), strict=True):
        figures.append(Figure(f"fused, rendered pictures, {name}", "m", None, theirs, mine,
                              note=f"{RENDERED_S[effort]:g} s, each its own front end"))  # fmt: skip
    for statistic in ("mean", "std"):
        figures.append(Figure(f"vision alone, rendered pictures, {statistic}", "m", PAPER["vision"][statistic == "std"],
                              _alone(real, "vision", statistic), _alone(seen, "vision", statistic)))  # fmt: skip
    plot = Plot(
        "Height error in hover",
        "Fused less true height of the first flight of each kind: the published filter follows its sensors' slow "
        "errors, ours stays at the centimetre as long as it sees the mark.",
        "time [s]", "error [m]", [Series(case, flown[case, False][0].t, flown[case, False][0].error) for case in CASES],
    )  # fmt: skip
    notes = [
        f"{FLIGHTS[effort]} flights a kind. Errors put in: barometer {BARO[0]} m constant and {BARO[1]} m wander, GPS "
        f"{GPS[0]} m and {GPS[1]} m (time constant {WANDER_TAU:g} s), every pair of signs; published vision: scale "
        f"{100 * SCALE:.1f} %, half the mark's length {SIZE_PX} px.",
    ]
    return Outcome(figures, [plot], notes=notes)
