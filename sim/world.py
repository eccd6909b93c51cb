"""The world: a vehicle in the air over a pad, its sensors and its cameras.

`step(controls)` moves it on by one group of physics ticks; `measure()` hands out what has arrived since. The truth is
there for the recorder; nobody who flies gets to see it.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import NoReturn, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from flightlog.atmosphere import pressure_at, temperature_at
from flightlog.constants import GRAVITY
from flightlog.equipment import CameraSpec
from flightlog.errors import UserError
from flightlog.marks import Mark
from flightlog.rotations import matrix, quaternion
from flightlog.signals import Controls, Measurement
from sim import sensors
from sim.assembly import assemble
from sim.cameras.shutter import Exposure, Eyes, Shutter
from sim.divergence import SimulationDiverged, suspect
from sim.light import Light
from sim.linearisation import Trim, trim
from sim.motion import advance, finite, observe
from sim.pipeline import Pipeline
from sim.randomness import generator
from sim.scene import MAIN_ROTOR, TAIL_ROTOR, CompiledScene
from sim.schedule import TICK, InTransit, Schedule
from sim.sensors.barometer import Barometer
from sim.sensors.contract import Sensor, Truth
from sim.sensors.faults import Fault, stamped
from sim.sensors.flow_camera import FlowCamera
from sim.sensors.pad_camera import PadCamera
from sim.terms.contract import GEOMETRY, SIGNALS, Term
from sim.vehicle import Vehicle
from sim.weather import Weather
from sim.wind import Gust, Wind

Floats = NDArray[np.float64]

TICKS_PER_STEP = 2  # the loop turns at 250 Hz, the rate of the IMU
STEP = TICKS_PER_STEP * TICK  # [s]
EYES = ("pad", "flow")  # what the down camera's front ends say where no picture is rendered
MAGNETIC_FIELD = np.array([0.0, 22.0, -42.0])  # [uT] ENU: middle latitudes, declination taken out


@dataclass(frozen=True, eq=False)
class Start:
    """Where the flight begins, trimmed in the air."""

    position: Floats = field(default_factory=lambda: np.array([0.0, 0.0, 10.0]))  # (3,) [m] ENU
    heading: float = 0.0  # [rad] clockwise from north


@dataclass(slots=True)
class Contact:
    """What touches the ground."""

    count: int = 0
    force: float = 0.0  # [N] sum of the normal forces


class World:
    """One flight's world. Use as a context manager: cameras hold a process."""

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        weather: Weather | None = None,
        light: Light | None = None,
        scene: str = "field",
        dip: bool = False,
        mark: Mark | None = None,
        start: Start | None = None,
        seeds: np.random.SeedSequence,
        cameras: Mapping[str, CameraSpec] | None = None,
        eyes: Callable[[CompiledScene], Eyes] | None = None,
        sensor_numbers: Mapping[str, Mapping[str, float]] | None = None,
        extra_terms: Sequence[Term] = (),
        extra_parameters: Mapping[str, Mapping[str, float]] | None = None,
        extra_faults: Sequence[Fault] = (),
    ) -> None:
        """Compile the scene, find the trim and stand ready at t = 0.

        sensor_numbers: by topic, what a scenario changes of the sensors as fitted; cameras: those that fly, where
        they are not the vehicle's own. eyes: opens the cameras on the compiled scene; None flies on the error
        models of what would look at the down camera's pictures instead.
        """
        self.vehicle = vehicle
        self.weather = weather or Weather()
        self.light = light or Light()
        start = start or Start()
        self.site = vehicle.site(self.weather.pressure, self.weather.temperature, MAGNETIC_FIELD)

        self.cameras = dict(vehicle.cameras if cameras is None else cameras)
        self.scene, self.model = assemble(vehicle, scene, mark, self.cameras, self.light, dip)
        # MuJoCo would start over from its own initial state where it meets a NaN; `_check` is to see it
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self.data = mujoco.MjData(self.model)
        self._body = self.model.body("vehicle").id
        self._qpos = self.data.qpos[:7]
        self._all_qvel = self.data.qvel
        self._qvel = self._all_qvel[:6]
        self._qfrc = self.data.qfrc_applied
        # the hinges show the rotors' speed; their reaction on the body lives in the terms
        self._turns = np.zeros(self.model.nv)
        self._turns[self.model.joint(MAIN_ROTOR).dofadr[0]] = vehicle.geometry["rotor_direction"]
        self._turns[self.model.joint(TAIL_ROTOR).dofadr[0]] = vehicle.parameters.get("tail_rotor", {}).get("gear", 1.0)
        self._hinge_mass = float(self.model.body_subtreemass[self._body] - self.model.body_mass[self._body])

        self.pipeline = Pipeline(
            (*vehicle.terms, *extra_terms), {**vehicle.parameters, **(extra_parameters or {})}, vehicle.geometry
        )
        self.wind = Wind(self.weather, generator(seeds, "wind"))
        self._air = self.wind.mean(float(start.position[2]))  # (3,) [m/s] ENU at the vehicle
        try:
            self.trim: Trim = trim(
                self.pipeline,
                vehicle.inertia,
                wind=self._air,
                height=float(start.position[2]),
                heading=start.heading,
                surface_pressure=self.weather.pressure,
                surface_temperature=self.weather.temperature,
            )
        except ValueError as error:
            raise UserError(
                f"{vehicle.path}: cannot hold its place at {start.position[2]:.1f} m in {self.weather.wind:g} m/s of "
                f"wind: {error}; less wind, less mass or more control would be right"
            ) from error
        self._geometry = np.zeros(1, GEOMETRY)
        self._geometry[0] = vehicle.geometry
        self._signals = np.zeros(1, SIGNALS)
        self._signals[0] = self.trim.signals
        self.signals = self._signals[0]  # a view
        self.signals["time"] = 0.0
        self.pipeline.state[:] = self.trim.state
        # as they were before the step under way, for whoever asks what went wrong
        self._sound_signals, self._sound_state = self._signals.copy(), self.pipeline.state.copy()
        # numpy copies records field by field, bytes at once
        self._signal_bytes, self._sound_bytes = self._signals.view(np.uint8), self._sound_signals.view(np.uint8)
        self.controls = self.trim.controls

        self.tick = 0
        self.contact = Contact()
        self._weigh(vehicle)
        self._qpos[:3] = start.position
        self._qpos[3:7] = quaternion(self.trim.roll, self.trim.pitch, start.heading)
        self._qvel[:] = 0.0
        mujoco.mj_forward(self.model, self.data)

        self._before = np.zeros(6)  # the free joint's velocity at the IMU's last sample
        self._before_t = 0.0
        self.truth = self._first_truth()
        self._fit_sensors(seeds, sensor_numbers or {}, mark, rendered=eyes is not None)
        self._faults: list[Fault] = list(extra_faults)
        self._fault_generator = generator(seeds, "faults")
        self._silent: dict[str, float] = {}  # device -> until when [s]
        self._transit = InTransit()
        self.eyes = eyes(self.scene) if eyes is not None else None
        self._shutter = Shutter(self.eyes, self.cameras) if self.eyes is not None else None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the cameras' process."""
        if self.eyes is not None:
            self.eyes.close()

    @property
    def pad_reading(self) -> tuple[float, float]:
        """Pressure [Pa] and temperature [K] that the barometer read on the pad before the flight."""
        baro = self._sensors.get("baro")
        if isinstance(baro, Barometer):
            return baro.pad_pressure, baro.pad_temperature
        return self.site.surface_pressure, self.site.surface_temperature

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.tick * TICK

    # --- the loop ---------------------------------------------------------------------------------------------------

    def step(self, controls: Controls) -> None:
        """Move on by one group of physics ticks; raises SimulationDiverged where the physics leaves the numbers."""
        self.controls = controls
        truth = self.truth
        u, w, a = truth.velocity, self._air, self.wind
        airspeed = math.hypot(u[0] - w[0], u[1] - w[1])
        self._air = a.step(float(self._qpos[2]), airspeed, STEP, self.t)
        sent = tuple(controls)
        self._sound_bytes[:] = self._signal_bytes
        self._sound_state = self.pipeline.state.copy()
        if not math.isfinite(sum(sent)):
            self._diverged()  # the servos' stops would make a number of it
        for _ in range(TICKS_PER_STEP):
            sound = advance(
                self.pipeline.kernels,
                self.pipeline.spans,
                self._signals,
                self._geometry,
                self.pipeline.state,
                self.pipeline.parameters,
                TICK,
                self._qpos,
                self._all_qvel,
                self._air,
                self.weather.pressure,
                self.weather.temperature,
                sent,
                self._turns,
                self._qfrc,
            )
            if not sound:
                self._diverged()
            mujoco.mj_step(self.model, self.data)
            self.tick += 1
            self._sample()
        self._set_mass()
        self._touch()
        self._check()

    def measure(self) -> list[Measurement]:
        """What has arrived since the last call, in order of arrival."""
        arrived = list(self._transit.arrived(self.tick))
        return [item.develop() if isinstance(item, Exposure) else item for item in arrived]

    # --- what a scenario may do to the world -------------------------------------------------------------------------

    def set_wind(self, speed: float, wind_from: float) -> None:
        """Change the mean wind at 10 m [m/s] and where it comes from [rad, clockwise from north]."""
        self.wind.set_mean(speed, wind_from)

    def add_gust(self, gust: Gust) -> None:
        """Let a gust come."""
        self.wind.add(gust)

    def set_light(self, light: Light) -> None:
        """Change the sun."""
        self.light = light

    def silence(self, device: str, until: float) -> None:
        """Sensor or camera `device` says nothing until that time [s]."""
        self._silent[device] = max(until, self._silent.get(device, 0.0))

    def add_fault(self, fault: Fault) -> None:
        """Corrupt what a sensor sends from now on."""
        self._faults.append(fault)

    def set_numbers(self, topic: str, numbers: Mapping[str, float]) -> None:
        """Change numbers of a sensor from now on, by the names of its PARAMETERS, SI."""
        self._sensors[topic].numbers.update(numbers)

    def numbers(self, topic: str, names: Iterable[str]) -> dict[str, float]:
        """What those numbers of a sensor are now."""
        return {name: self._sensors[topic].numbers[name] for name in names}

    def error_columns(self) -> dict[str, tuple[tuple[str, str], ...]]:
        """By topic, name and unit of each sensor's true fault states."""
        return {topic: sensor.ERRORS for topic, sensor in self._sensors.items()}

    def sensor_errors(self) -> dict[str, tuple[float, ...]]:
        """By topic, the true fault states behind each sensor's last sample."""
        return {topic: sensor.errors() for topic, sensor in self._sensors.items()}

    # --- inside -----------------------------------------------------------------------------------------------------

    def _weigh(self, vehicle: Vehicle) -> None:
        """The vehicle file's mass and inertia, whatever the MJCF says; the centre of mass is the body's origin."""
        body = self._body
        self.model.body_ipos[body] = 0.0
        self.model.body_iquat[body] = (1.0, 0.0, 0.0, 0.0)
        self.model.body_inertia[body] = vehicle.inertia
        self._set_mass()
        mujoco.mj_setConst(self.model, self.data)

    def _set_mass(self) -> None:
        """Fuel burns: the body's mass follows, to a tenth of a gram."""
        mass = float(self.signals["mass"]) - self._hinge_mass
        if abs(mass - self.model.body_mass[self._body]) > 1e-4:
            self.model.body_mass[self._body] = mass

    def _first_truth(self) -> Truth:
        height = float(self._qpos[2])
        rotation = matrix(self._qpos[3:7])
        return Truth(
            t=0.0,
            position=self._qpos[:3].copy(),
            velocity=np.zeros(3),
            quaternion=self._qpos[3:7].copy(),
            rotation=rotation,
            rates=np.zeros(3),
            angular_acceleration=np.zeros(3),
            specific_force=rotation.T @ np.array([0.0, 0.0, GRAVITY]),
            rotor_speed=float(self.signals["rotor_speed"]),
            thrust=float(self.signals["thrust"]),
            inflow=float(self.signals["inflow"]),
            wind=self._air.copy(),
            pressure=pressure_at(height, self.weather.pressure, self.weather.temperature),
            temperature=temperature_at(height, self.weather.temperature),
        )

    def _fit_sensors(
        self,
        seeds: np.random.SeedSequence,
        changed: Mapping[str, Mapping[str, float]],
        mark: Mark | None,
        rendered: bool,
    ) -> None:
        self._sensors: dict[str, Sensor] = {}
        for topic, fitted in self.vehicle.sensors.items():
            numbers = {**fitted.numbers, **changed.get(topic, {})}
            device = generator(seeds, topic)
            if topic not in EYES:
                self._sensors[topic] = sensors.CATALOGUE[topic](numbers, fitted.position, self.site, device)
                continue
            # without a mark to look for the down camera watches the ground move
            if rendered or "down" not in self.cameras or topic != ("flow" if mark is None else "pad"):
                continue
            camera = self.cameras["down"]
            numbers |= {"rate": camera.rate, "latency": camera.latency}
            args = numbers, camera.mount.position, self.site, device
            if mark is None:
                self._sensors[topic] = FlowCamera(*args, camera=camera.model, mount=camera.mount)
            else:
                numbers["focal_scale"] = numbers.get("focal_scale", 1.0) * camera.focal_scale
                numbers["delay"] = numbers.get("delay", 0.0) + camera.stamp_delay
                numbers["k1"] = numbers.get("k1", 0.0) + camera.k1_error
                self._sensors[topic] = PadCamera(*args, camera=camera.model, mount=camera.mount, mark=mark)
        rates = {topic: sensor.numbers["rate"] for topic, sensor in self._sensors.items()}
        if rendered:
            rates |= {name: camera.rate for name, camera in self.cameras.items()}
        self._schedule = Schedule(rates)

    def _sample(self) -> None:
        """Let every device that is due at this tick look at the truth."""
        due = self._schedule.due(self.tick)
        if not due:
            return
        self._look("imu" in due)
        for name in due:
            if self._silent and self._silent.get(name, 0.0) > self.truth.t:
                continue
            if name in self.cameras and self._shutter is not None:
                exposure = self._shutter.expose(name, self.truth.t, self.data, self.light)
                self._transit.send(exposure, exposure.t_arrival)
                continue
            sensor = self._sensors[name]
            sample = sensor.sample(self.truth)
            ahead = sensor.numbers.get("clock", 0.0)
            if sample is not None and ahead:
                sample = stamped(sample, ahead)
            for fault in self._faults:
                if sample is not None and fault.topic == name:
                    sample = fault.apply(sample, self.truth.t, self._fault_generator)
            if sample is not None:
                latency = sensor.numbers.get("latency", 0.0)
                self._transit.send(sample, getattr(sample, "t_arrival", sample.t + latency))

    def _look(self, means_end: bool) -> None:
        """Bring the truth up to this tick; `means_end`: the IMU's next means begin here."""
        truth = self.truth
        t = self.tick * TICK
        truth.rotor_speed, truth.thrust, truth.inflow, truth.pressure, truth.temperature = observe(
            self._signals, self._qpos, self._qvel, self._before, t - self._before_t, self.weather.pressure,
            self.weather.temperature, truth.position, truth.quaternion, truth.rotation, truth.velocity, truth.rates,
            truth.specific_force, truth.angular_acceleration,
        )  # fmt: skip
        truth.t = t
        truth.wind[:] = self._air
        if means_end:
            self._before[:] = self._qvel
            self._before_t = t

    def _touch(self) -> None:
        """What touches the ground now."""
        contact = self.contact
        contact.count = self.data.ncon
        contact.force = 0.0
        if contact.count:
            wrench = np.zeros(6)
            for i in range(contact.count):
                mujoco.mj_contactForce(self.model, self.data, i, wrench)
                contact.force += float(wrench[0])

    def _check(self) -> None:
        """Stop where the physics has left the numbers."""
        if not finite(self._qpos, self._qvel, float(self.signals["rotor_speed"])):
            self._diverged()

    def _diverged(self) -> NoReturn:
        """Say when, in what state, and why."""
        last = self.truth
        qpos = np.concatenate([last.position, last.quaternion])
        qvel = np.concatenate([last.velocity, last.rates])
        surface = (self.weather.pressure, self.weather.temperature)
        before = (self._sound_signals[0], self._sound_state)
        cause = suspect(self.pipeline, *before, qpos, qvel, self._air, surface, self.controls)
        raise SimulationDiverged(
            f"the physics left the numbers at t = {self.t:.3f} s; last sound state: position "
            f"{np.round(last.position, 2).tolist()} m, velocity {np.round(last.velocity, 2).tolist()} m/s, rates "
            f"{np.round(last.rates, 2).tolist()} rad/s, rotor {last.rotor_speed:.1f} rad/s; likely cause: {cause}"
        )
