"""The vehicle file: what flies, every number with unit, tolerance and source.

`load` reads `assets/vehicles/<name>.toml` or a user's file into a `Vehicle`: SI numbers, terms in force, sensors and
cameras as fitted. An extended model is just another vehicle file.
"""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

import assets
from flightlog import toml_file
from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec, Equipment, SensorSpec
from flightlog.errors import UserError
from flightlog.marks import HMark
from sim import sensors, terms
from sim.parameters import Parameter
from sim.sensors.contract import Site
from sim.terms.contract import GEOMETRY, Term
from sim.units import to_si

Floats = NDArray[np.float64]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Number(_Strict):
    """A number of the vehicle file; a vector where its key is one."""

    value: float | list[float]
    unit: str
    tolerance: float | list[float] = 0.0  # one standard deviation of what the maker does not know
    source: str = ""


class Rotor(_Strict):
    """The main rotor's geometry."""

    radius: Number
    chord: Number
    blades: int = Field(ge=1)
    nominal_speed: Number
    turns: Literal["clockwise", "counter-clockwise"]  # seen from above
    hub: Number


class TailRotor(_Strict):
    """The tail rotor's place."""

    hub: Number


class Skids(_Strict):
    """The landing gear's place."""

    height: Number  # body origin above the skids' plane


class Camera(_Strict):
    """A camera as fitted."""

    looks: Literal["down", "forward"]
    rate: Number
    latency: Number
    position: Number
    nose_down: Number | None = None
    width: int = Field(ge=16)
    height: int = Field(ge=16)
    fx: Number
    fy: Number
    distortion: Number | None = None  # k1, k2, p1, p2, k3
    colour: bool = True


class Environment(_Strict):
    """The weather expected where this vehicle flies; `diagnose` takes it as the null."""

    wind_std: Number


class VehicleFile(_Strict):
    """The whole file, as written."""

    kind: Literal["helicopter"]
    model: str
    mass: Number
    inertia: Number
    rotor: Rotor
    tail_rotor: TailRotor
    skids: Skids
    environment: Environment
    terms: dict[str, dict[str, Number]]
    sensors: dict[str, dict[str, Number]]
    cameras: dict[str, Camera]


@dataclass(frozen=True, eq=False)
class Fitted:
    """A sensor as fitted: its parameters by name, SI, and its mount."""

    numbers: Mapping[str, float]
    position: Floats  # (3,) [m] body axes


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A vehicle file, checked and in SI."""

    name: str
    path: Path
    document: Mapping[str, Any]  # as written, overrides included
    model: Path  # MJCF
    inertia: Floats  # (3,) [kg m^2] about the body origin, principal axes = body axes
    geometry: np.void  # sim.terms.contract.GEOMETRY
    terms: tuple[Term, ...]
    parameters: Mapping[str, Mapping[str, float]]  # by term and name
    sensors: Mapping[str, Fitted]  # by topic
    cameras: Mapping[str, CameraSpec]

    def site(self, surface_pressure: float, surface_temperature: float, magnetic_field: Floats) -> Site:
        """What the sensors need to know of the place and of this vehicle."""
        return Site(
            surface_pressure=surface_pressure,
            surface_temperature=surface_temperature,
            magnetic_field=magnetic_field,
            rotor_radius=float(self.geometry["rotor_radius"]),
            nominal_rotor_speed=float(self.geometry["nominal_speed"]),
            hub_height=float(self.geometry["hub"][2]),
            skid_height=float(self.geometry["skid_height"]),
        )

    def equipment(self, mark: HMark, site: Site) -> Equipment:
        """The sensors as the navigator is told of them: nominal numbers, never drawn errors."""
        return Equipment(
            sensors={
                topic: SensorSpec(
                    fitted.numbers["rate"], fitted.numbers.get("latency", 0.0), fitted.position, fitted.numbers
                )
                for topic, fitted in self.sensors.items()
            },
            cameras=self.cameras,
            mark=mark,
            skid_height=site.skid_height,
            nominal_rotor_speed=site.nominal_rotor_speed,
            surface_pressure=site.surface_pressure,
            surface_temperature=site.surface_temperature,
            magnetic_field=site.magnetic_field,
        )


def available() -> list[str]:
    """Names of the vehicles that come with the project."""
    return sorted(path.stem for path in assets.path("vehicles").glob("*.toml"))


def find(name: str | Path) -> Path:
    """The file of a vehicle's name, or the path of a user's own file; UserError where there is none."""
    path = Path(name)
    if path.suffix == ".toml":
        if not path.is_file():
            raise UserError(f"{path}: no such vehicle file")
        return path
    own = assets.path("vehicles", f"{name}.toml")
    if not own.is_file():
        raise UserError(f"unknown vehicle {str(name)!r}; {toml_file.nearest(str(name), available())}")
    return own


def load(name: str | Path, overrides: Mapping[str, Any] | None = None) -> Vehicle:
    """The vehicle of that name or file, with `overrides` by dotted key (`terms.drag.area`); UserError for any fault."""
    path = find(name)
    if not overrides:
        return _as_written(path, path.stat().st_mtime_ns)
    document = toml_file.read(path)
    for key, value in overrides.items():
        toml_file.assign(document, key, value)
    return _resolve(path, document, toml_file.validate(document, VehicleFile, path))


@functools.lru_cache(maxsize=32)
def _as_written(path: Path, changed: int) -> Vehicle:
    """The file as it is; `changed` [ns] tells its versions apart."""
    del changed
    document = toml_file.read(path)
    return _resolve(path, document, toml_file.validate(document, VehicleFile, path))


def _resolve(path: Path, document: Mapping[str, Any], file: VehicleFile) -> Vehicle:
    def scalar(number: Number, unit: str, key: str) -> float:
        if isinstance(number.value, list):
            raise UserError(f"{path}: {key}: must be one number in {unit} (got {number.value})")
        return to_si(number.value, number.unit, unit, f"{path}: {key}")

    def vector(number: Number, unit: str, key: str, length: int = 3) -> Floats:
        if not isinstance(number.value, list) or len(number.value) != length:
            raise UserError(f"{path}: {key}: must be {length} numbers in {unit} (got {number.value})")
        return np.array([to_si(value, number.unit, unit, f"{path}: {key}") for value in number.value])

    def declared(section: str, given: Mapping[str, Number], known: Sequence[Parameter]) -> dict[str, float]:
        names = [parameter.name for parameter in known]
        for name in given:
            if name not in names:
                raise UserError(f"{path}: {section}.{name}: unknown key; {toml_file.nearest(name, names)}")
        numbers = {}
        for parameter in known:
            key = f"{section}.{parameter.name}"
            if parameter.name in given:
                value = scalar(given[parameter.name], parameter.unit, key)
            elif parameter.default is not None:
                value = parameter.default
            else:
                raise UserError(f"{path}: {key}: is missing ({parameter.meaning}, in {parameter.unit})")
            if not parameter.low <= value <= parameter.high:
                raise UserError(
                    f"{path}: {key}: must lie in {parameter.low:g} .. {parameter.high:g} {parameter.unit} (got {value:g})"
                )
            numbers[parameter.name] = value
        return numbers

    for name in file.terms:
        if name not in terms.CATALOGUE:
            raise UserError(f"{path}: terms.{name}: unknown term; {toml_file.nearest(name, terms.CATALOGUE)}")
    for topic in file.sensors:
        if topic not in sensors.CATALOGUE:
            raise UserError(f"{path}: sensors.{topic}: unknown sensor; {toml_file.nearest(topic, sensors.CATALOGUE)}")

    geometry = np.zeros(1, dtype=GEOMETRY)[0]
    radius = scalar(file.rotor.radius, "m", "rotor.radius")
    chord = scalar(file.rotor.chord, "m", "rotor.chord")
    geometry["mass"] = scalar(file.mass, "kg", "mass")
    geometry["rotor_radius"] = radius
    geometry["rotor_solidity"] = file.rotor.blades * chord / (math.pi * radius)
    geometry["rotor_direction"] = 1.0 if file.rotor.turns == "counter-clockwise" else -1.0
    geometry["nominal_speed"] = scalar(file.rotor.nominal_speed, "rad/s", "rotor.nominal_speed")
    geometry["hub"] = vector(file.rotor.hub, "m", "rotor.hub")
    geometry["tail_hub"] = vector(file.tail_rotor.hub, "m", "tail_rotor.hub")
    geometry["skid_height"] = scalar(file.skids.height, "m", "skids.height")

    fitted = {}
    for topic, given in file.sensors.items():
        numbers = {name: number for name, number in given.items() if name != "position"}
        position = vector(given["position"], "m", f"sensors.{topic}.position") if "position" in given else np.zeros(3)
        fitted[topic] = Fitted(declared(f"sensors.{topic}", numbers, sensors.CATALOGUE[topic].PARAMETERS), position)

    cameras = {}
    for name, camera in file.cameras.items():
        key = f"cameras.{name}"
        position = vector(camera.position, "m", f"{key}.position")
        if camera.looks == "down":
            mount = CameraMount.downward(position)
        else:
            nose_down = scalar(camera.nose_down, "rad", f"{key}.nose_down") if camera.nose_down else 0.0
            mount = CameraMount.forward(position, nose_down)
        distortion = vector(camera.distortion, "1", f"{key}.distortion", 5) if camera.distortion else np.zeros(5)
        k1, k2, p1, p2, k3 = distortion.tolist()
        model = CameraModel(
            camera.width,
            camera.height,
            scalar(camera.fx, "px", f"{key}.fx"),
            scalar(camera.fy, "px", f"{key}.fy"),
            (camera.width - 1) / 2,
            (camera.height - 1) / 2,
            (k1, k2, p1, p2, k3),
        )
        rate = scalar(camera.rate, "Hz", f"{key}.rate")
        cameras[name] = CameraSpec(rate, scalar(camera.latency, "s", f"{key}.latency"), model, mount, camera.colour)

    mjcf = path.parent / file.model
    if not mjcf.is_file():
        mjcf = assets.path("vehicles", file.model)
    if not mjcf.is_file():
        raise UserError(f"{path}: model: no file {file.model!r} beside it or among the project's vehicles")

    return Vehicle(
        name=path.stem,
        path=path,
        document=document,
        model=mjcf,
        inertia=vector(file.inertia, "kg m^2", "inertia"),
        geometry=geometry,
        terms=tuple(terms.CATALOGUE[name] for name in file.terms),
        parameters={
            name: declared(f"terms.{name}", given, terms.CATALOGUE[name].parameters)
            for name, given in file.terms.items()
        },
        sensors=fitted,
        cameras=cameras,
    )
