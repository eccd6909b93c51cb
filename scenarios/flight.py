"""Closes the loop: world -> measurements -> navigator -> state -> pilot -> controls -> world.

The navigator gets measurements and what is known of the equipment, the pilot gets the navigator's state. The truth goes
to the logbook and to the observer alone.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightlog.marks import HMark
from scenarios import cameras as camera_tables
from scenarios.crew import Navigator, NavigatorMaker, Pilot, PilotMaker, make_navigator, make_pilot
from scenarios.events import Script, sensor_numbers
from scenarios.recording import Recording
from scenarios.schema import Scenario
from scenarios.stopwatch import Stopwatch
from scenarios.summary import Observer, Summary
from sim import vehicle as vehicles
from sim.cameras.rendering import RenderProcess
from sim.randomness import generator
from sim.vehicle import Vehicle
from sim.world import SimulationDiverged, Start, World

Floats = NDArray[np.float64]

AFTER_LANDING = 2.0  # [s] flown on after landing, so that the rotor is seen to run down
PADS = {"h": HMark(), "none": None}

Progress = Callable[[float, str, float], None]  # time [s], phase, estimated height [m]


@dataclass(frozen=True)
class Flight:
    """A flight that has been flown."""

    scenario: str
    seed: tuple[int, ...]
    vehicle: str
    summary: Summary
    wall_s: float  # first physics step to the end of the flight
    startup_s: float  # compiling, trim, OpenGL
    real_time_factor: float
    renderer: str | None  # None: flown without cameras
    shares: dict[str, float]  # of wall_s, by what took it
    folder: Path | None


def fly(
    scenario: Scenario,
    *,
    seed: int | tuple[int, ...] = 0,
    folder: Path | None = None,
    cameras: bool = True,
    vehicle: Vehicle | None = None,
    aboard: Vehicle | None = None,
    navigator: NavigatorMaker = make_navigator,
    pilot: PilotMaker = make_pilot,
    keep_frames: bool = False,
    name: str = "scenario",
    progress: Progress | None = None,
) -> Flight:
    """Fly a scenario once.

    Args:
        scenario: what to fly.
        seed: all randomness of the flight; same scenario and seed give the same flight, bit for bit.
        folder: where the flight is written; None: nowhere.
        cameras: False: the pad camera's error model in place of rendered pictures.
        vehicle: what flies; by default the scenario's vehicle.
        aboard: the vehicle that pilot and navigator were designed for; by default the scenario's.
        navigator: makes the navigator from the equipment, see `scenarios.crew`.
        pilot: makes the pilot likewise.
        keep_frames: write the pictures into the flight too.
        name: of the scenario, for the log.
        progress: called about ten times a simulated second.

    Raises:
        UserError: unusable input. SimulationDiverged: the physics left the numbers; the log up to there is kept.
    """
    started = time.perf_counter()
    seeds = np.random.SeedSequence(seed)
    nominal = aboard or vehicles.load(scenario.vehicle)
    flying = vehicle or vehicles.load(scenario.vehicle)
    mark = PADS[scenario.pad]
    fitted = camera_tables.fitted(flying.cameras, scenario.cameras)
    imaging = camera_tables.imaging(fitted, scenario.cameras)
    noise_seed = int(generator(seeds, "cameras").integers(2**31))
    start = _start(scenario, seeds)

    with World(
        flying,
        weather=scenario.weather.weather(),
        light=scenario.light.light(),
        scene=scenario.scene,
        dip=scenario.horizon_dip,
        mark=mark,
        start=start,
        seeds=seeds,
        cameras=fitted,
        eyes=(lambda scene: RenderProcess(scene, imaging, noise_seed)) if cameras else None,
        sensor_numbers={
            topic: sensor_numbers(topic, table.model_dump())
            for topic, table in ((topic, getattr(scenario.sensors, topic)) for topic in type(scenario.sensors).model_fields)
        },
    ) as world:
        equipment = nominal.equipment(mark or HMark(), world.site)
        crew_navigator = navigator(equipment, scenario, cameras)
        crew_pilot = pilot(nominal, world.site, scenario, start.heading)
        observer = Observer(world, equipment)
        recording = Recording.open(folder, world, scenario, name, seeds, flying, nominal, keep_frames=keep_frames)
        startup = time.perf_counter() - started
        with recording:
            watch = Stopwatch()
            reason = "interrupted"
            try:
                reason = _loop(scenario, world, crew_navigator, crew_pilot, observer, recording, watch, progress)
            except SimulationDiverged as failure:
                reason = str(failure)
                raise
            finally:
                flight = _result(
                    scenario, name, seeds, flying, world, crew_pilot, observer, reason, watch, startup, folder
                )
                recording.conclude(flight)
        return flight


def _loop(
    scenario: Scenario,
    world: World,
    navigator: Navigator,
    pilot: Pilot,
    observer: Observer,
    recording: Recording,
    watch: Stopwatch,
    progress: Progress | None,
) -> str:
    """Fly until the pilot is done or time is up; says how it ended."""
    script = Script(scenario)
    controls = world.trim.controls
    done_at = math.inf
    next_progress = 0.0
    watch.start()
    while True:
        recording.events(world.t, script.play(world, pilot))
        world.step(controls)
        watch.lap("physics")
        measurements = world.measure()
        watch.lap("rendering")
        state = navigator.update(measurements)
        watch.lap("navigator")
        flown, controls = controls, pilot.update(state)
        watch.lap("pilot")
        if pilot.descending:
            observer.leaves_point(world.t)
        observer.watch(world, state, measurements, navigator.detections)
        recording.step(world, measurements, navigator, state, flown, pilot)
        watch.lap("logging")
        t = world.t
        if progress is not None and t >= next_progress:
            progress(t, pilot.phase_name, float(state.position[2]))
            next_progress = t + 0.1
        if pilot.done and done_at == math.inf:
            done_at = t + AFTER_LANDING
        if t >= done_at:
            return pilot.outcome
        if t >= scenario.duration_s - 1e-9:
            return "time is up" if scenario.plan.goal == "land" else "held to the end"


def _start(scenario: Scenario, seeds: np.random.SeedSequence) -> Start:
    """Where the flight begins; drawn evenly from a ball around the plan's point unless given."""
    heading = math.radians(scenario.start.heading_deg)
    if scenario.start.position_m is not None:
        return Start(np.array(scenario.start.position_m), heading)
    rng = generator(seeds, "start")
    direction = rng.standard_normal(3)
    radius = scenario.start.spread_m * rng.random() ** (1 / 3)
    position = np.array(scenario.plan.point_m) + radius * direction / np.linalg.norm(direction)
    return Start(position, heading)
