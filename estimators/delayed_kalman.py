"""A linear Kalman filter whose late measurements act at their time of validity.

    x' = A x + B u + w,   z = H x + v

The inputs u (an acceleration) are known and held from one epoch to the next, as an inertial sensor's means over its
sampling interval are. States, covariances and inputs of the last epochs are kept in a ring; measurements are kept in
order of time. A measurement from the past, in whatever order it arrives, sends the filter back to the epoch before it,
and everything since is computed anew: the result is that of a batch in order of time, exactly, for every delay.

A scalar measurement at a time. The gain follows Lei et al. 2012, equation 27, read as: full up to a residual of two
standard deviations, n K with n = 2 sqrt(S)/|r| up to five, nothing beyond; Joseph's form, because n K is not the
optimal gain. A filter that has gone astray must not reject the truth for ever: after `patience` rejections in a row
either the bias that the component may have jumped by is set free, or, where it has none and no reference agrees with
the filter, it begins anew with its first covariance.

A state may be a copy: of row x as it was at some time, correlated with what it was copied from (a stochastic clone).
What is measured against it later, such as the way since a picture was taken, is then an ordinary measurement. Copying
is kept among the measurements, so that it too is done again in order of time.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimators import replay

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Component:
    """One scalar kind of measurement, such as the east of a GPS position."""

    topic: int  # number of its sensor: components of one topic do not vouch for each other
    patience: int  # rejections in a row after which something must be wrong
    jump: int = -1  # state that absorbs a jump of this sensor's bias; -1: it has none
    reference: bool = False  # free of bias: where it agrees with the filter, the filter is right
    copies: int = -1  # state that becomes row x when this comes, nothing being measured; -1: a measurement


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Continuous-time model of n states with m inputs."""

    dynamics: Floats  # A (n, n) [1/s]
    inputs: Floats  # B (n, m)
    noise: Floats  # (n, n) density of w
    input_noise: Floats  # (n, n) density of w from the inputs; each epoch scales it
    components: Sequence[Component]


@dataclass(frozen=True, eq=False)
class Innovations:
    """What the stored measurements met when they were last applied; arrays of one length."""

    t: Floats  # [s]
    component: NDArray[np.int64]
    residual: Floats
    variance: Floats  # of the residual, prior
    weight: Floats  # [0..1] of equation 27


class DelayedKalman:
    """The filter with its memory."""

    def __init__(
        self, model: LinearModel, t: float, x: ArrayLike, p: ArrayLike, *, epochs: int = 160, room: int = 0
    ) -> None:
        """Starts at `t` [s] with state `x` (n,) and covariance `p` (n, n); remembers so many epochs.

        `room`: states that the memory has space for; filters of equal memories share what is compiled for them.
        """
        a = np.asarray(model.dynamics, float)
        n = len(a)
        topics = 1 + max(component.topic for component in model.components)
        inputs = np.shape(model.inputs)[1]
        self.memory = np.zeros(1, replay.memory_type(max(n, room), inputs, len(model.components), topics, epochs))
        head = self.memory[0]
        self._ring = head["ring"]
        self._fill(model, a)
        root = self._ring[0]
        root["t"], root["noise"] = t, 1.0
        root["x"][:n], root["p"][:n, :n] = x, p
        root["accepted"] = -np.inf
        head["model"]["start"][:n] = np.diag(np.asarray(p, float))
        # told at run time, so that the compiler does not unroll every loop
        head["model"]["states"], head["model"]["inputs"] = n, inputs
        head["epochs"], head["dirty"] = 1, np.inf

    def _fill(self, model: LinearModel, a: Floats) -> None:
        """Taylor coefficients of the transition, the input's effect and the noise over one step."""
        record, n = self.memory[0]["model"], len(a)

        def put(prefix: str, first: Floats, second: Floats, third: Floats) -> None:
            for number, matrix in enumerate((first, second / 2, third / 6), 1):
                record[f"{prefix}{number}"][:n, : matrix.shape[1]] = matrix

        put("a", a, a @ a, a @ a @ a)
        b = np.asarray(model.inputs, float)
        put("g", b, a @ b, a @ a @ b)
        # integral over s of exp(A s) Q exp(A' s)
        for prefix, density in (("q", model.noise), ("w", model.input_noise)):
            q1 = np.asarray(density, float)
            q2 = a @ q1 + q1 @ a.T
            q3 = a @ q2 + q2 @ a.T
            put(prefix, q1, q2, q3)
        for name in ("topic", "patience", "jump", "reference", "copies"):
            record[name] = [int(getattr(component, name)) for component in model.components]

    def advance(self, t: float, u: Floats, noise: float = 1.0) -> bool:
        """On to `t` [s] with the inputs `u` (m,) of the time since the last epoch; False where `t` is not ahead.

        `noise` multiplies the density of the inputs' noise, for spans in which they are missing.
        """
        return bool(replay.advance(self.memory, t, u, noise))

    def insert(self, t: float, component: int, row: Floats, z: float, variance: float) -> int:
        """A measurement z = row x valid at `t` [s]; TAKEN or why not, as `estimators.replay` has it.

        It acts at the next `refresh` or `advance`.
        """
        return int(replay.insert(self.memory, t, component, row, z, variance))

    def refresh(self) -> None:
        """Let what was inserted act."""
        replay.refresh(self.memory)

    def state_at(self, t: float) -> tuple[Floats, Floats]:
        """(x (n,), P (n, n)) at a time within the memory [s]."""
        return replay.state_at(self.memory, t)  # type: ignore[no-any-return]

    @property
    def last(self) -> np.void:
        """The latest epoch: t, x, p, rejections, resets and accepted (by topic [s]); x and p with their spare room."""
        return self._ring[(int(self.memory["epochs"][0]) - 1) % len(self._ring)]

    @property
    def rejected(self) -> NDArray[np.int64]:
        """Measurements of each component that had no weight when they were first applied."""
        return self.memory["rejected"][0].copy()

    def innovations(self) -> Innovations:
        """Of the measurements in memory, in order of time."""
        rows = self.memory["store"][0, : int(self.memory["stored"][0])]
        rows = rows[self.memory["model"]["copies"][0][rows["component"]] < 0]
        return Innovations(*(rows[name].copy() for name in ("t", "component", "residual", "spread", "weight")))
