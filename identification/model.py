"""The vehicle's model with every number that may be turned."""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightlog.units import to_si
from identification.dynamics import answer
from identification.grid import Drive
from sim.pipeline import Pipeline
from sim.terms import CATALOGUE
from sim.terms.contract import GEOMETRY
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]

STILL = np.zeros(3)

# terms that a vehicle file may lack: in force with numbers that do nothing, so that they can be turned
NEUTRAL: Mapping[str, Mapping[str, float]] = {
    "ground_effect": {"gain": 0.0},
    "fuel": {"rate": 0.0, "capacity": 50.0},
    "drag": {"area": 0.0, "linear": 0.0},
    "deadband": {"width": 0.0, "release": 0.0},
    "vortex_ring": {"depth": 0.0},
    "cg_offset": {"x": 0.0, "y": 0.0, "z": 0.0},
    "rotor_droop": {"droop": 0.0},
}

# numbers of the vehicle file beside its terms, and where they stand: fields of GEOMETRY, and the sensor's arm
GEOMETRIC: Mapping[str, str] = {
    "mass": "mass",
    "rotor.radius": "rotor_radius",
    "rotor.solidity": "rotor_solidity",
    "rotor.nominal_speed": "nominal_speed",
    **{f"rotor.hub.{i}": f"hub.{i}" for i in range(3)},
    **{f"tail_rotor.hub.{i}": f"tail_hub.{i}" for i in range(3)},
    **{f"sensors.imu.position.{i}": f"arm.{i}" for i in range(3)},
}


@dataclass(frozen=True)
class Knob:
    """One number of the model: `inertia.0`, `terms.<term>.<parameter>`, or one of GEOMETRIC."""

    key: str
    unit: str
    nominal: float
    tolerance: float  # one standard deviation of what the maker does not know; 0: known
    step: float  # for a derivative
    low: float
    high: float


class Model:
    """The terms in force, and those that could be, along measured flights."""

    def __init__(self, vehicle: Vehicle) -> None:
        """From a vehicle file; the file's own numbers are the nominal ones."""
        self.vehicle = vehicle
        names = [term.name for term in vehicle.terms]
        added = [name for name in NEUTRAL if name not in names]
        self._parameters = {name: dict(values) for name, values in vehicle.parameters.items()}
        self._parameters |= {name: dict(NEUTRAL[name]) for name in added}
        self._terms = [*vehicle.terms, *(CATALOGUE[name] for name in added)]
        self._pipeline = Pipeline(self._terms, self._parameters, vehicle.geometry)
        self._places = {
            f"terms.{term.name}.{p.name}": int(span[2]) + i
            for term, span in zip(self._pipeline.terms, self._pipeline.spans, strict=True)
            for i, p in enumerate(term.parameters)
        }
        self.knobs: dict[str, Knob] = {knob.key: knob for knob in self._knobs()}

    @property
    def toleranced(self) -> list[Knob]:
        """Numbers that the maker does not know exactly."""
        return [knob for knob in self.knobs.values() if knob.tolerance > 0.0]

    def answer(
        self,
        drive: Drive,
        wind: Floats,
        changes: Mapping[str, float] | None = None,
        puff: Floats = STILL,
        coarse: bool = False,
    ) -> Floats:
        """The model's answer (N, 7) along a flight, with some numbers changed [SI].

        wind (3,) [m/s] ENU at 10 m with its profile; puff (3,) or of each node (N, 3), the same at every
        height; coarse: in long steps, for
        derivatives.
        """
        pipeline, inertia, arm = self._pipeline, self.vehicle.inertia.copy(), drive.arm.copy()
        parameters = pipeline.parameters.copy()
        geometry = np.zeros(1, dtype=GEOMETRY)
        geometry[0] = pipeline.geometry
        for key, value in (changes or {}).items():
            field, _, axis = GEOMETRIC.get(key, key).partition(".")
            if key in self._places:
                parameters[self._places[key]] = value
            elif field == "inertia":
                inertia[int(axis)] = value
            elif field == "arm":
                arm[int(axis)] = value
            elif axis:
                geometry[0][field][int(axis)] = value
            else:
                geometry[0][field] = value
        return answer(
            pipeline, parameters, geometry, inertia, arm, drive.coarse if coarse else drive.fine, wind, puff
        )

    def answers(
        self, drive: Drive, runs: Sequence[tuple[Floats, Mapping[str, float], Floats]], coarse: bool = True
    ) -> list[Floats]:
        """Many answers (N, 7), each for its (wind, changes, puff), on all cores."""
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return list(pool.map(lambda run: self.answer(drive, run[0], run[1], run[2], coarse), runs))

    def answers_on(self, drives: Sequence[Drive], wind: Floats, changes: Mapping[str, float]) -> list[Floats]:
        """Answers (N, 7) in long steps along several drives, on all cores."""
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return list(pool.map(lambda drive: self.answer(drive, wind, changes, coarse=True), drives))

    def _knobs(self) -> Sequence[Knob]:
        document = self.vehicle.document
        knobs = [*self._geometric()]
        spread = tolerance_of(document, "inertia", "kg m^2")
        for axis, value in enumerate(self.vehicle.inertia.tolist()):
            of_axis = spread[axis] if isinstance(spread, list) else spread
            knobs.append(Knob(f"inertia.{axis}", "kg m^2", value, of_axis, 0.02 * value, 0.1 * value, 10.0 * value))
        for term in self._terms:
            for p in term.parameters:
                key = f"terms.{term.name}.{p.name}"
                value = self._parameters[term.name][p.name]
                tolerance = tolerance_of(document, key, p.unit)
                step = STEPS.get(key) or tolerance or 0.02 * abs(value)
                if step > 0.0:
                    knobs.append(Knob(key, p.unit, value, tolerance, step, p.low, p.high))
        return knobs

    def _geometric(self) -> Sequence[Knob]:
        document, geometry = self.vehicle.document, self.vehicle.geometry
        mass, solidity = float(geometry["mass"]), float(geometry["rotor_solidity"])
        radius, speed = float(geometry["rotor_radius"]), float(geometry["nominal_speed"])
        chord = tolerance_of(document, "rotor.chord", "m") / (np.pi * radius * solidity) * document["rotor"]["blades"]
        vectors = {
            "rotor.hub": geometry["hub"], "tail_rotor.hub": geometry["tail_hub"],
            "sensors.imu.position": self.vehicle.sensors["imu"].position,
        }  # fmt: skip
        return [
            Knob("mass", "kg", mass, tolerance_of(document, "mass", "kg"), 0.01 * mass, 0.1 * mass, 10.0 * mass),
            _share("rotor.radius", "m", radius, tolerance_of(document, "rotor.radius", "m")),
            _share("rotor.solidity", "1", solidity, float(chord) * solidity),
            _share("rotor.nominal_speed", "rad/s", speed, tolerance_of(document, "rotor.nominal_speed", "rad/s")),
            *(
                Knob(f"{key}.{i}", "m", float(vector[i]), tolerance_of(document, key, "m"), 0.005, -10.0, 10.0)
                for key, vector in vectors.items()
                for i in range(3)
            ),
        ]


def _share(key: str, unit: str, value: float, tolerance: float) -> Knob:
    return Knob(key, unit, value, tolerance, 0.01 * value, 0.5 * value, 2.0 * value)


# [SI] for the derivative by a number whose nominal value is nothing, or whose effect is rough
STEPS = {
    "terms.drag.area": 0.02,
    "terms.drag.linear": 0.1,
    "terms.deadband.width": 0.004,
    "terms.deadband.release": 0.5,
    "terms.vortex_ring.depth": 0.1,
    "terms.cg_offset.x": 0.003,
    "terms.cg_offset.y": 0.003,
    "terms.cg_offset.z": 0.01,
    "terms.servo.delay": 0.008,
    "terms.servo.second": 0.1,
    "terms.fuel.rate": 2e-4,
    "terms.rotor_droop.droop": 0.03,
}


def tolerance_of(document: Mapping[str, Any], dotted: str, unit: str) -> Any:
    """A number's tolerance in SI; 0 where the file declares none."""
    entry: Any = document
    for part in dotted.split("."):
        entry = entry.get(part) if isinstance(entry, Mapping) else None
    if not isinstance(entry, Mapping):
        return 0.0
    given = entry.get("tolerance", 0.0)
    zero = to_si(0.0, entry["unit"], unit)
    scaled = [to_si(float(v), entry["unit"], unit) - zero for v in (given if isinstance(given, list) else [given])]
    return scaled if isinstance(given, list) else scaled[0]


def describe(knob: Knob) -> dict[str, Any]:
    """A knob as plain numbers."""
    return dataclasses.asdict(knob)
