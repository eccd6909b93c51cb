"""Derivatives of the model's answer along one flight: by its numbers, the wind, its shear and errors of the rates."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.flight import Flight
from identification.grid import sheared, turned
from identification.model import Model

Floats = NDArray[np.float64]

# what shows in a tenth of a second needs the simulator's own tick for its slope too
QUICK = (
    "terms.servo.delay", "terms.servo.tau", "terms.servo.second", "terms.servo.rate_limit", "terms.flapping",
    "terms.hub", "inertia", "terms.deadband", "terms.cg_offset", "rotor.nominal_speed", "sensors.imu.position",
    "terms.main_rotor.inflow_mass", "terms.rotor_droop",
)  # fmt: skip
# for the derivative by what is rough, once it is in force
CLOSE_BY = {"terms.deadband.width": 3e-4, "terms.deadband.release": 0.02}
WIND_STEP = 0.5  # [m/s]
RATE_STEP = 0.01  # [rad/s]
SHEAR_STEP = 0.3
WINDS = ("wind.e", "wind.n")


def knob_slopes(
    model: Model, flight: Flight, wind: Floats, keys: Sequence[str], at: Mapping[str, float] | None = None,
    rough: bool = False,
) -> dict[str, Floats]:  # fmt: skip
    """Derivative (N, 7) of the answer by every one of these numbers, one-sided, about the nominal or changed model.

    rough: all of them in long steps, also of what shows in a tenth of a second.
    """
    at = dict(at or {})
    still = np.zeros(3)
    steps = {}
    for key in keys:
        knob = model.knobs[key]
        here = at.get(key, knob.nominal)
        step = knob.step if here == knob.nominal else CLOSE_BY.get(key, knob.step)
        steps[key] = step if here + step <= knob.high else -step
    moved = {key: at | {key: at.get(key, model.knobs[key].nominal) + step} for key, step in steps.items()}
    slopes: dict[str, Floats] = {}
    for coarse in (False, True):
        chosen = [key for key in keys if (rough or not key.startswith(QUICK)) is coarse]
        if not chosen:
            continue
        runs = [(wind, at, still), *((wind, moved[key], still) for key in chosen)]
        base, *found = model.answers(flight.drive, runs, coarse)
        slopes |= {key: (answer - base) / steps[key] for key, answer in zip(chosen, found, strict=True)}
    return slopes


def wind_slopes(model: Model, flight: Flight, wind: Floats, at: Mapping[str, float]) -> dict[str, Floats]:
    """Derivative (N, 7) of the answer by the wind at 10 m, east and north."""
    still, steps = np.zeros(3), WIND_STEP * np.eye(3)[:2]
    runs = model.answers(flight.drive, [(wind + sign * s, at, still) for s in steps for sign in (1.0, -1.0)])
    return {name: (runs[2 * i] - runs[2 * i + 1]) / (2.0 * WIND_STEP) for i, name in enumerate(WINDS)}


def shear_slope(model: Model, flight: Flight, wind: Floats, at: Mapping[str, float]) -> Floats:
    """Derivative (N, 7) of the answer by the shear of the mean wind."""
    drives = [
        replace(flight.drive, coarse=sheared(flight.drive.coarse, step)) for step in (SHEAR_STEP, -SHEAR_STEP)
    ]
    more, less = model.answers_on(drives, wind, at)
    return np.asarray((more - less) / (2.0 * SHEAR_STEP))


def rate_slopes(
    model: Model, flight: Flight, wind: Floats, rates: Mapping[str, Floats], at: Mapping[str, float]
) -> dict[str, Floats]:
    """Derivative (N, 7) of the answer by what the gyro reads too much: rates (N, 3) [rad/s] by key."""
    if not rates:
        return {}
    drive = flight.drive
    sizes = {key: RATE_STEP / max(float(np.abs(rate).max()), 1e-9) for key, rate in rates.items()}
    still = np.zeros((len(flight.motion.t), 3))
    grids = [turned(drive.coarse, rate) for rate in [still, *(rates[key] * sizes[key] for key in rates)]]
    base, *found = model.answers_on([replace(drive, coarse=grid) for grid in grids], wind, at)
    return {key: (answer - base) / sizes[key] for key, answer in zip(rates, found, strict=True)}
