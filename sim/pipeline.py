"""The terms in force, put in order and run as one compiled call."""

from collections.abc import Mapping, Sequence

import numba
import numpy as np
from numba import types
from numpy.typing import NDArray

from sim.kernel_call import ADDRESSES, addresses, call
from sim.terms.contract import GEOMETRY, SIGNALS, Term

Floats = NDArray[np.float64]

_signals = numba.from_dtype(SIGNALS)
_geometry = numba.from_dtype(GEOMETRY)
_vector = types.Array(types.float64, 1, "C")
_spans = types.Array(types.int64, 2, "C")


@numba.njit(
    types.void(ADDRESSES, _spans, _signals, _geometry, _vector, _vector, types.float64), cache=True
)
def run(kernels, spans, s, v, x, p, dt):  # type: ignore[no-untyped-def]
    """Bring the model dt [s] further: `s`, `x` in place; spans (N, 4): where each term's states and parameters lie."""
    s.ground = 1.0
    s.mass = v.mass
    for axis in range(3):
        s.force[axis] = 0.0
        s.moment[axis] = 0.0
    for i in range(len(kernels)):
        call(kernels[i], s, v, x, spans[i, 0], spans[i, 1], p, spans[i, 2], spans[i, 3], dt)  # type: ignore[call-arg]


@numba.njit(
    types.void(
        ADDRESSES, _spans, _signals, _geometry, _vector, _vector, types.float64, types.int64,
        types.int64, types.float64,
    ),
    cache=True,
)  # fmt: skip
def settle(kernels, spans, s, v, x, p, dt, steps, held, value):  # type: ignore[no-untyped-def]
    """Run `steps` times at unchanged motion and controls, the state number `held` kept at `value` (< 0: none)."""
    controls = (s.collective, s.lateral, s.longitudinal, s.tail, s.throttle)
    for _ in range(steps):
        s.collective, s.lateral, s.longitudinal, s.tail, s.throttle = controls
        if held >= 0:
            x[held] = value
        run(kernels, spans, s, v, x, p, dt)
    if held >= 0:
        x[held] = value


class Pipeline:
    """The model of one vehicle: terms in their order, parameters and states in flat vectors."""

    def __init__(
        self, terms: Sequence[Term], parameters: Mapping[str, Mapping[str, float]], geometry: np.void
    ) -> None:
        """Build from `terms` with `parameters` by term and name, SI; raises KeyError for one that is missing."""
        self.terms = tuple(sorted(terms, key=lambda term: term.stage))  # stable: file order within a stage
        self.geometry = geometry
        self.kernels = addresses([term.kernel for term in self.terms])
        spans = []
        state_names: list[str] = []
        values: list[float] = []
        initial: list[float] = []
        for term in self.terms:
            first_state, first_parameter = len(state_names), len(values)
            state_names += [f"{term.name}.{name}" for name in term.states]
            initial += list(term.initial) or [0.0] * len(term.states)
            values += [float(parameters[term.name][declared.name]) for declared in term.parameters]
            spans.append((first_state, len(state_names), first_parameter, len(values)))
        self.spans = np.array(spans, dtype=np.int64).reshape(-1, 4)
        self.state_names = tuple(state_names)
        self.parameters: Floats = np.array(values, dtype=np.float64)
        self.state: Floats = np.array(initial, dtype=np.float64)

    def signals(self) -> np.void:
        """A record of the pipeline's signals, to be filled and run.

        All zero but the rotor, which turns at its nominal speed as long as no term says otherwise.
        """
        s = np.zeros(1, dtype=SIGNALS)[0]
        s["rotor_speed"] = self.geometry["nominal_speed"]
        return s

    def set_parameter(self, term: str, name: str, value: float) -> None:
        """Change a number in force."""
        for item, span in zip(self.terms, self.spans, strict=True):
            if item.name == term:
                names = [declared.name for declared in item.parameters]
                self.parameters[span[2] + names.index(name)] = value
                return
        raise KeyError(term)

    def state_index(self, name: str) -> int:
        """Where the state `term.name` lies in the state vector; -1 where the model has none."""
        return self.state_names.index(name) if name in self.state_names else -1

    def run(self, s: np.void, dt: float) -> None:
        """Bring signals `s` and the states dt [s] further."""
        run(self.kernels, self.spans, s, self.geometry, self.state, self.parameters, dt)

    def settle(self, s: np.void, dt: float, steps: int, hold_rotor_speed: float) -> None:
        """Let the states come to rest at the motion and controls in `s`, the rotor kept at a speed [rad/s]."""
        held = self.state_index("engine.speed")
        settle(
            self.kernels, self.spans, s, self.geometry, self.state, self.parameters, dt, steps, held, hold_rotor_speed
        )
