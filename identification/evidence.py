"""From flights to the stack that hypotheses compete on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.causes import CATALOGUE, Cause, Change, Parameter
from identification.drive import Driven, Noise, drive
from identification.flight import Flight
from identification.model import Model
from identification.stack import Rows, signatures
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]

FORCE_FLOOR = 0.02  # [m/s^2] of offset that geometry and model leave open on any flight


@dataclass(frozen=True, eq=False)
class Evidence:
    """One flight under one model, ready to be stacked with others."""

    driven: Driven
    rows: Rows
    slopes: dict[str, Floats]  # by knob, (N, 7)


def testable(vehicle: Vehicle, topics: set[str]) -> tuple[list[Cause], dict[str, list[str]]]:
    """Causes that these topics can show on this kind of vehicle, and what the others lack."""
    kind = vehicle.document["kind"]
    of_kind = [cause for cause in CATALOGUE.values() if kind in cause.kinds]
    lacking = {cause.name: [topic for topic in cause.needs if topic not in topics] for cause in of_kind}
    return [cause for cause in of_kind if not lacking[cause.name]], {n: m for n, m in lacking.items() if m}


def knob_slopes(
    model: Model, flight: Flight, wind: Floats, keys: Sequence[str], at: Mapping[str, float] | None = None
) -> dict[str, Floats]:
    """Derivative (N, 7) of the answer by every one of these numbers, one-sided, about the nominal or changed model."""
    at = dict(at or {})
    still = np.zeros(3)
    steps = {}
    for key in keys:
        knob = model.knobs[key]
        steps[key] = knob.step if at.get(key, knob.nominal) + knob.step <= knob.high else -knob.step
    moved = [at | {key: at.get(key, model.knobs[key].nominal) + step} for key, step in steps.items()]
    base, *found = model.answers(flight.drive, [(wind, changes, still) for changes in [at, *moved]])
    return {key: (answer - base) / steps[key] for key, answer in zip(keys, found, strict=True)}


def wind_slopes(model: Model, flight: Flight, wind: Floats, at: Mapping[str, float] | None = None) -> Floats:
    """Derivative (N, 7, 2) of the answer by the wind at 10 m, east and north."""
    still, steps = np.zeros(3), 0.5 * np.eye(3)[:2]
    runs = model.answers(flight.drive, [(wind + sign * s, at or {}, still) for s in steps for sign in (1.0, -1.0)])
    return np.stack([runs[0] - runs[1], runs[2] - runs[3]], axis=-1)


def gather(
    model: Model, flight: Flight, causes: Sequence[Cause], noise: Noise, wind: Floats, wind_left: float
) -> Evidence:
    """Everything that one flight says, linear about the nominal model in a `wind` (3,) known to `wind_left` [m/s]."""
    keys = {p.key for cause in causes if cause.changes is None for p in cause.parameters}
    keys |= {knob.key for knob in model.toleranced}
    driven = drive(model, flight, wind, noise)
    slopes = knob_slopes(model, flight, wind, sorted(keys))
    return whiten(model, driven, causes, noise, slopes, wind_slopes(model, flight, wind), wind_left)


def whiten(
    model: Model, driven: Driven, causes: Sequence[Cause], noise: Noise, slopes: dict[str, Floats], by_wind: Floats,
    wind_left: float,
) -> Evidence:  # fmt: skip
    """The rows of one flight from what was computed of the model."""
    flight = driven.flight
    changes: dict[str, Change] = {}
    for cause in causes:
        if cause.changes is not None:
            found = cause.changes(flight, model.vehicle)
            changes |= {p.key: change for p, change in zip(cause.parameters, found, strict=True)}
    declared = {f"local.{p.key}": change for p, change, _ in _declared(flight, model.vehicle)}
    nodes, scalars = len(flight.motion.t), len(flight.motion.kinds)
    pushed = np.zeros((nodes, 7, 3))
    for axis in range(3):
        pushed[:, axis, axis] = 1.0
    by_model = slopes | {f"wind.{a}": by_wind[:, :, i] for i, a in enumerate("en")}
    every = signatures(driven, noise, by_model, changes | declared)
    bias = driven.whiten(np.zeros_like(pushed), noise, pushed).reshape(7 * nodes, 3)
    local = np.column_stack(
        [
            every.pop("wind.e"), every.pop("wind.n"), np.vstack([np.zeros((scalars, 3)), bias]),
            *(every.pop(key) for key in declared),
        ]
    )  # fmt: skip
    offset = np.hypot(model.vehicle.sensors["imu"].numbers["accel_bias_std"], FORCE_FLOOR)
    residual = np.concatenate([flight.motion.whitened, driven.residual.ravel()])
    times = np.concatenate([flight.motion.times, np.repeat(flight.motion.t, 7)])
    channel = np.concatenate([flight.motion.kinds, 100 + np.tile(np.arange(7), nodes)])
    early = times < flight.motion.t[0] + 1.0
    residual[early] = 0.0
    local[early] = 0.0
    for column in every.values():
        column[early] = 0.0
    std = np.array([wind_left, wind_left, *[offset] * 3, *(std for _, _, std in _declared(flight, model.vehicle))])
    return Evidence(driven, Rows(residual, every, local, std, channel, times), slopes)


def _declared(flight: Flight, vehicle: Vehicle) -> list[tuple[Parameter, Change, float]]:
    """What the inertial sensor's scale and mount may be off by on any one flight, as its maker declares."""
    numbers = vehicle.sensors["imu"].numbers
    found = []
    for name, spread in (("imu_scale", ("accel_scale_std", "gyro_scale_std")), ("imu_misalignment", None)):
        cause = CATALOGUE[name]
        assert cause.changes is not None
        for parameter, change in zip(cause.parameters, cause.changes(flight, vehicle), strict=True):
            std = numbers["misalignment_std"] if spread is None else numbers[spread[parameter.name[0] == "w"]]
            found.append((parameter, change, std))
    return found


def priors(model: Model, causes: Sequence[Cause]) -> tuple[dict[str, float], dict[str, float]]:
    """By parameter key, what may be without any cause, and how large a cause may make it."""
    tolerances = {knob.key: knob.tolerance for knob in model.toleranced}
    sensors = model.vehicle.document["sensors"]
    for cause in causes:
        for p in cause.parameters:
            if p.tolerance is not None:
                _, topic, name = p.tolerance.split(".")
                tolerances[p.key] = float(sensors[topic][name]["tolerance"])
    spreads = {p.key: max(p.spread, 3.0 * tolerances.get(p.key, 0.0)) for cause in causes for p in cause.parameters}
    return tolerances, spreads


def unexplained(item: Evidence, tolerances: Mapping[str, float], spreads: Mapping[str, float]) -> Floats:
    """What is left (R,) of a flight after everything that has a name was taken out."""
    rows = item.rows
    std = {key: max(tolerances.get(key, 0.0), spreads.get(key, 0.0)) for key in rows.signatures}
    full = np.column_stack([rows.local * rows.local_std, *(rows.signatures[key] * std[key] for key in std)])
    solved = np.linalg.solve(np.eye(full.shape[1]) + full.T @ full, full.T @ rows.residual)
    return np.asarray(rows.residual - full @ solved)


def winds(model: Model, flight: Flight, noise: Noise, spread: float) -> Floats:
    """The mean wind (3,) [m/s] at 10 m that explains a flight best under the nominal model."""
    wind = np.zeros(3)
    for _ in range(3):
        item = gather(model, flight, (), noise, wind, spread)
        local = item.rows.local * item.rows.local_std
        full = np.column_stack([local, *(item.rows.signatures[k.key] * k.tolerance for k in model.toleranced)])
        solved = np.linalg.solve(np.eye(full.shape[1]) + full.T @ full, full.T @ item.rows.residual)
        wind = wind + np.append(spread * solved[:2], 0.0)
    return wind


def refined(noise: Noise, evidence: Sequence[Evidence], left: Sequence[Floats]) -> Noise:
    """Noise levels from what is `left` (R,) of each flight after everything was explained."""
    factors = []
    for k in range(7):
        values = np.concatenate(
            [part[item.rows.channel == 100 + k] for item, part in zip(evidence, left, strict=True)]
        )
        values = values[values != 0.0]
        factors.append(float(np.median(np.abs(values))) / 0.6745 if len(values) > 40 else 1.0)
    f = np.clip(factors, 0.2, 5.0)
    return replace(
        noise, noise=tuple(n * s for n, s in zip(noise.noise, f, strict=True)),
        process=tuple(n * s for n, s in zip(noise.process, f, strict=True)),
    )  # fmt: skip

