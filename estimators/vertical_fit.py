"""Equation 13's coefficients from flights: differential evolution, then least squares.

The paper used an adaptive genetic algorithm. Short free runs of the model, each begun from the logged state, are
compared with the logged climb rate and rotor speed. The pitch angle of the blades is not in a log: equation 13 knows it
up to a scale, which is chosen so that a settled servo stands at the angle sent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution, least_squares

from estimators.vertical_model import OMEGA, THETA, V, VerticalModel

Floats = NDArray[np.float64]
Columns = Mapping[str, Floats]

STEP = 0.02  # [s]
WINDOW = 3.0  # [s] of a free run
CLIMB_STD, SPEED_STD = 0.05, 0.5  # [m/s], [rad/s]: what one residual is measured in
FAR = 1e4  # residuals that say no more than that the model ran away

# search ranges; those of one sign over decades are searched by their logarithm
_LOW, _HIGH = np.log([1e-9, 1e-3, 1e-14, 1e-10]), np.log([1e-2, 1e-1, 1e-4, 1e-3])
_BOUNDS = np.array(
    [(-25.0, -2.0), (-4.0, 0.5), (-1.0, 1.0), *zip(_LOW, _HIGH, strict=True), (-400.0, 400.0), (-10.0, 0.0),
     (-0.2, 0.0), (-0.02, 0.0), (-50.0, 50.0), (-3000.0, -200.0), (-0.01, 0.01), (-110.0, -20.0), (0.0, 1500.0)]
)  # fmt: skip
UNKNOWNS = len(_BOUNDS)  # fifteen coefficients and the throttle's gain


@dataclass(frozen=True, eq=False)
class VerticalLog:
    """What of one flight equation 13 is fitted to, on a common clock of STEP seconds."""

    climb: Floats  # (N,) [m/s]
    speed: Floats  # (N,) [rad/s] of the rotor
    inputs: Floats  # (N, 2) throttle [0..1], collective [rad], held over the step that begins here

    @classmethod
    def of(cls, tables: Mapping[str, Columns], begin: float, end: float) -> "VerticalLog":
        """From the tables controls, rotor and estimate (or reference) of a log, between two times [s] of its clock.

        Raises:
            KeyError: a table or column is missing.
        """
        t = np.arange(begin, end, STEP)
        controls, rotor = tables["controls"], tables["rotor"]
        motion = tables["reference"] if "reference" in tables else tables["estimate"]
        middle = t + 0.5 * STEP
        inputs = [np.interp(middle, controls["t"], controls[name]) for name in ("throttle", "collective")]
        # the tachometer's noise is white, the rotor is slow
        speed = np.interp(t, rotor["t"], _smooth(rotor["speed"], 5))
        return cls(np.interp(t, motion["t"], motion["vu"]), speed, np.stack(inputs, axis=-1))


def _smooth(values: Floats, width: int) -> Floats:
    """Centred mean of an odd number of neighbours."""
    kernel = np.ones(width) / width
    return np.convolve(np.pad(values, width // 2, mode="edge"), kernel, mode="valid")


@dataclass(frozen=True, eq=False)
class Windows:
    """Pieces of flights of one length, W of them, K steps long."""

    climb: Floats  # (W, K)
    speed: Floats  # (W, K)
    inputs: Floats  # (W, K, 2)

    @classmethod
    def cut(cls, logs: Sequence[VerticalLog], span: float = WINDOW) -> "Windows":
        """One after the other out of each flight; raises ValueError where no flight is as long."""
        size = round(span / STEP)
        climb, speed, inputs = [], [], []
        for log in logs:
            for first in range(0, len(log.climb) - size + 1, size):
                piece = slice(first, first + size)
                climb.append(log.climb[piece])
                speed.append(log.speed[piece])
                inputs.append(log.inputs[piece])
        if not climb:
            raise ValueError(f"no flight is as long as a window of {span:g} s")
        return cls(np.array(climb), np.array(speed), np.array(inputs))

    def run(self, model: VerticalModel) -> tuple[Floats, Floats]:
        """Climb rates and rotor speeds (..., W, K) of free runs from each window's first state.

        A model of many coefficient sets (15, S, 1) makes (S, W, K).
        """
        windows, steps = self.climb.shape
        shape = np.broadcast_shapes(np.shape(model.a[0]), (windows,))
        x = np.zeros((*shape, 5))
        x[..., V], x[..., OMEGA] = self.climb[:, 0], self.speed[:, 0]
        x[..., THETA] = self.inputs[:, 0, 1]
        climb, speed = np.empty((*shape, steps)), np.empty((*shape, steps))
        for k in range(steps):
            climb[..., k], speed[..., k] = x[..., V], x[..., OMEGA]
            x = model.step(x, self.inputs[:, k], STEP)
        return climb, speed


def _model(unknowns: Floats) -> VerticalModel:
    """From the search's numbers (16,) or (16, S); a12 and the servo's gain cancel at rest."""
    numbers = unknowns if unknowns.ndim == 1 else unknowns[..., None]
    a = np.array(numbers[:15])
    a[3:7] = np.exp(a[3:7])
    return VerticalModel(a, numbers[15], -a[12])


def _residuals(unknowns: Floats, windows: Windows) -> Floats:
    """(N,) or (S, N) of all windows, in CLIMB_STD and SPEED_STD."""
    with np.errstate(over="ignore", invalid="ignore"):
        climb, speed = windows.run(_model(unknowns))
        parts = [(climb - windows.climb) / CLIMB_STD, (speed - windows.speed) / SPEED_STD]
    lead = climb.shape[:-2]
    return np.concatenate([np.clip(np.nan_to_num(part, nan=FAR), -FAR, FAR).reshape(*lead, -1) for part in parts],
                          axis=-1)  # fmt: skip


@dataclass(frozen=True, eq=False)
class VerticalFit:
    """A fitted model and how well it runs freely along the flights of the fit."""

    model: VerticalModel
    climb_rms: float  # [m/s] over the windows
    speed_rms: float  # [rad/s]
    generations: int


def fit_vertical_model(
    logs: Sequence[VerticalLog], *, seed: int, generations: int = 60, searched: int = 24
) -> VerticalFit:
    """Equation 13's coefficients for the machine that flew `logs`.

    seed: of the evolution. searched: windows that the evolution looks at; least squares then takes all of them.

    Raises:
        ValueError: the flights are shorter than a window.
    """
    windows = Windows.cut(logs)
    some = np.random.default_rng(seed).permutation(len(windows.climb))[:searched]
    sample = Windows(windows.climb[some], windows.speed[some], windows.inputs[some])

    def cost(population: Floats) -> Floats:
        return np.asarray(np.log(np.mean(_residuals(population, sample) ** 2, axis=-1)))

    found = differential_evolution(
        cost, _BOUNDS, rng=seed, popsize=6, maxiter=generations, vectorized=True, updating="deferred", polish=False,
        init="sobol", mutation=(0.4, 0.9), recombination=0.8, tol=1e-6,
    )  # fmt: skip
    scale = np.ptp(_BOUNDS, axis=1)
    low, high = _BOUNDS.T
    start = np.clip(found.x, low + 1e-6 * scale, high - 1e-6 * scale)
    polished = least_squares(
        lambda unknowns: _residuals(unknowns, windows), start, bounds=(low, high), x_scale=scale, loss="soft_l1",
        max_nfev=60,
    )  # fmt: skip
    model = _model(polished.x)
    model = VerticalModel(model.a, float(model.throttle_gain), float(model.collective_gain))
    return VerticalFit(model, *errors(model, logs), int(found.nit))


def errors(model: VerticalModel, logs: Sequence[VerticalLog], span: float = WINDOW) -> tuple[float, float]:
    """RMS of climb rate [m/s] and rotor speed [rad/s] in free runs of `span` seconds along flights."""
    windows = Windows.cut(logs, span)
    climb, speed = windows.run(model)
    return float(np.sqrt(np.mean((climb - windows.climb) ** 2))), float(np.sqrt(np.mean((speed - windows.speed) ** 2)))
