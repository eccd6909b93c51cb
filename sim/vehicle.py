"""The vehicle file: what flies, every number with unit, tolerance and source.

`load` reads `assets/vehicles/<name>.toml` or a user's file into a `Vehicle`: SI numbers, terms in force, sensors and
cameras as fitted. An extended model is just another vehicle file.
"""

import functools
import math
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

import assets
from flightlog import toml_file
from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec, Equipment, SensorSpec
from flightlog.errors import UserError
from flightlog.marks import Mark
from sim import sensors, terms
from sim.parameters import Parameter
from sim.sensors.contract import Site
from sim.terms.contract import GEOMETRY, Term
from sim.vehicle_extension import Extension
from sim.vehicle_numbers import Number, Reader, Strict

Floats = NDArray[np.float64]


class Rotor(Strict):
    """The main rotor's geometry."""

    radius: Number
    chord: Number
    blades: int = Field(ge=1)
    nominal_speed: Number
    turns: Literal["clockwise", "counter-clockwise"]  # seen from above
    hub: Number


class TailRotor(Strict):
    """The tail rotor's place."""

    hub: Number


class Skids(Strict):
    """The landing gear's place."""

    height: Number  # body origin above the skids' plane


class Camera(Strict):
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
    # errors that a diagnosis found; zero where there are none
    focal_scale: Number | None = None  # true focal length over fx and fy
    roll: Number | None = None  # right side down, against what it looks along
    pitch: Number | None = None  # nose up
    stamp_delay: Number | None = None  # by which stamps are late
    k1: Number | None = None  # of the lens, beyond that of `distortion`


class Environment(Strict):
    """The weather expected where this vehicle flies; `diagnose` takes it as the null."""

    wind_std: Number
    # mean wind at 10 m that a diagnosis found, where the air moves to, and its profile; scenarios that say nothing of
    # the wind have it
    wind_e: Number | None = None
    wind_n: Number | None = None
    wind_shear: Number | None = None


class VehicleFile(Strict):
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
    extension: Extension | None = None


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
    wind: tuple[float, float, float] = (0.0, 0.0, 1.0)  # [m/s] mean at 10 m where the air moves to, e and n; its shear

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

    def equipment(self, mark: Mark | None, site: Site) -> Equipment:
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
        if not os.path.isfile(path):
            raise UserError(f"{path}: no such vehicle file")
        return path
    if str(name) not in available():
        raise UserError(f"unknown vehicle {str(name)!r}; {toml_file.nearest(str(name), available())}")
    return assets.path("vehicles", f"{name}.toml")


def load(name: str | Path, overrides: Mapping[str, Any] | None = None) -> Vehicle:
    """The vehicle of that name or file, with `overrides` by dotted key (`terms.drag.area`); UserError for any fault."""
    path = find(name)
    if not overrides:
        return _as_written(path, path.stat().st_mtime_ns)
    document = toml_file.read(path)
    for key, value in overrides.items():
        toml_file.assign(document, key, _with_unit(document, key, value))
    return _resolve(path, document, tuple(toml_file.VEHICLE + key for key in overrides))


def from_document(document: Mapping[str, Any], source: Path | str) -> Vehicle:
    """The vehicle of a file's content, such as a flight keeps; UserError, which names `source`, for any fault."""
    return _resolve(Path(source), document)


@functools.lru_cache(maxsize=32)
def _as_written(path: Path, changed: int) -> Vehicle:
    """The file as it is; `changed` [ns] tells its versions apart."""
    del changed
    return _resolve(path, toml_file.read(path))


def _with_unit(document: Mapping[str, Any], dotted: str, value: Any) -> Any:
    """A bare number for a key that the file leaves at its default is in the unit that its term or sensor declares."""
    section, member, name, *_ = [*dotted.split("."), "", ""]
    declared: Sequence[Parameter] = ()
    if section == "terms" and member in terms.KNOWN:
        declared = terms.KNOWN[member].parameters
    elif section == "sensors" and member in sensors.CATALOGUE:
        declared = sensors.CATALOGUE[member].PARAMETERS
    units = {parameter.name: parameter.unit for parameter in declared}
    bare = section in ("terms", "sensors") and name and not isinstance(value, dict)
    if not bare or name in document.get(section, {}).get(member, {}):
        return value
    return {"value": value, "unit": units.get(name, "1")}


def _resolve(path: Path, document: Mapping[str, Any], settings: Collection[str] = ()) -> Vehicle:
    if document.get("kind") == "rig":
        raise UserError(f"{path}: kind: found 'rig', which does not fly; `helideck predict` and `diagnose` run rigs")
    if document.get("kind") == "multirotor":
        raise UserError(f"{path}: kind: found 'multirotor'; `land` flies helicopters, `diagnose` takes all kinds")
    file = toml_file.validate(document, VehicleFile, path, settings)
    reader = Reader(path, settings)
    for name in file.terms:
        if name not in terms.KNOWN:
            reader.fail(f"terms.{name}", f"unknown term; {toml_file.nearest(name, terms.CATALOGUE)}")
    for topic in file.sensors:
        if topic not in sensors.CATALOGUE:
            reader.fail(f"sensors.{topic}", f"unknown sensor; {toml_file.nearest(topic, sensors.CATALOGUE)}")

    geometry = np.zeros(1, dtype=GEOMETRY)[0]
    radius = reader.scalar(file.rotor.radius, "m", "rotor.radius", positive=True)
    chord = reader.scalar(file.rotor.chord, "m", "rotor.chord", positive=True)
    speed = reader.scalar(file.rotor.nominal_speed, "rad/s", "rotor.nominal_speed", positive=True)
    geometry["mass"] = reader.scalar(file.mass, "kg", "mass", positive=True)
    geometry["rotor_radius"] = radius
    geometry["rotor_solidity"] = file.rotor.blades * chord / (math.pi * radius)
    geometry["rotor_direction"] = 1.0 if file.rotor.turns == "counter-clockwise" else -1.0
    geometry["nominal_speed"] = speed
    geometry["hub"] = reader.vector(file.rotor.hub, "m", "rotor.hub")
    geometry["tail_hub"] = reader.vector(file.tail_rotor.hub, "m", "tail_rotor.hub")
    geometry["skid_height"] = reader.scalar(file.skids.height, "m", "skids.height", positive=True)

    fitted = {}
    for topic, given in file.sensors.items():
        numbers = {name: number for name, number in given.items() if name != "position"}
        place = f"sensors.{topic}.position"
        position = reader.vector(given["position"], "m", place) if "position" in given else np.zeros(3)
        known = sensors.CATALOGUE[topic].PARAMETERS
        fitted[topic] = Fitted(reader.declared(f"sensors.{topic}", numbers, known), position)

    air = file.environment
    wind = [
        reader.scalar(number, unit, f"environment.wind_{name}") if number else usual
        for name, number, unit, usual in (
            ("e", air.wind_e, "m/s", 0.0), ("n", air.wind_n, "m/s", 0.0), ("shear", air.wind_shear, "1", 1.0)
        )
    ]  # fmt: skip

    mjcf = path.parent / file.model
    if not mjcf.is_file():
        mjcf = assets.path("vehicles", file.model)
    if not mjcf.is_file():
        reader.fail("model", f"no file {file.model!r} beside it or among the project's vehicles")

    return Vehicle(
        name=path.stem,
        path=path,
        document=document,
        model=mjcf,
        inertia=reader.inertia(file.inertia, "inertia"),
        geometry=geometry,
        terms=tuple(terms.KNOWN[name] for name in file.terms),
        parameters={
            name: reader.declared(f"terms.{name}", given, terms.KNOWN[name].parameters)
            for name, given in file.terms.items()
        },
        sensors=fitted,
        cameras={name: _camera(reader, f"cameras.{name}", camera) for name, camera in file.cameras.items()},
        wind=(wind[0], wind[1], wind[2]),
    )


def _camera(reader: Reader, key: str, camera: Camera) -> CameraSpec:
    position = reader.vector(camera.position, "m", f"{key}.position")
    if camera.looks == "down":
        mount = CameraMount.downward(position)
    else:
        nose_down = reader.scalar(camera.nose_down, "rad", f"{key}.nose_down") if camera.nose_down else 0.0
        mount = CameraMount.forward(position, nose_down)
    turn = [reader.scalar(n, "rad", f"{key}.{name}") if n else 0.0
            for name, n in (("roll", camera.roll), ("pitch", camera.pitch))]  # fmt: skip
    if any(turn):
        mount = mount.turned(*turn)
    focal = reader.scalar(camera.focal_scale, "1", f"{key}.focal_scale", positive=True) if camera.focal_scale else 1.0
    delay = reader.scalar(camera.stamp_delay, "s", f"{key}.stamp_delay") if camera.stamp_delay else 0.0
    distortion = reader.vector(camera.distortion, "1", f"{key}.distortion", 5) if camera.distortion else np.zeros(5)
    k1, k2, p1, p2, k3 = distortion.tolist()
    k1_error = reader.scalar(camera.k1, "1", f"{key}.k1") if camera.k1 else 0.0
    model = CameraModel(
        camera.width,
        camera.height,
        focal * reader.scalar(camera.fx, "px", f"{key}.fx", positive=True),
        focal * reader.scalar(camera.fy, "px", f"{key}.fy", positive=True),
        (camera.width - 1) / 2,
        (camera.height - 1) / 2,
        (k1 + k1_error, k2, p1, p2, k3),
    )
    rate = reader.scalar(camera.rate, "Hz", f"{key}.rate", positive=True)
    latency = reader.scalar(camera.latency, "s", f"{key}.latency")
    if not 0.0 <= latency <= 2.0:
        reader.fail(f"{key}.latency", f"must lie in 0 .. 2 s (got {latency:g})")
    if not -0.5 <= delay <= 1.0:
        reader.fail(f"{key}.stamp_delay", f"must lie in -0.5 .. 1 s (got {delay:g})")
    if not -1.0 <= k1_error <= 1.0:
        reader.fail(f"{key}.k1", f"must lie in -1 .. 1 (got {k1_error:g})")
    return CameraSpec(rate, latency, model, mount, camera.colour, focal, delay, k1_error)
