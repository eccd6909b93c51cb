"""Closes the loop: world -> measurements -> navigator -> state -> pilot -> controls -> world.

The navigator gets measurements and what is known of the equipment, the pilot gets the navigator's state. The truth goes
to the logbook and to the observer alone.
"""

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from estimators.navigators import Navigator, Steered
from flightlog.errors import UserError
from flightlog.signals import Measurement, StateEstimate
from scenarios.crew import NavigatorMaker, Pilot, PilotMaker, make_navigator, make_pilot
from scenarios.events import Script
from scenarios.recording import FolderRecording, Recording, Unrecorded, versions
from scenarios.rehearsal import rehearse
from scenarios.schema import Scenario, Target
from scenarios.staging import make_equipment, make_world
from scenarios.stopwatch import Stopwatch
from scenarios.summary import Observer, Summary
from sim import vehicle as vehicles
from sim.cameras import RenderError
from sim.cameras.rendering import RenderProcess
from sim.vehicle import Vehicle
from sim.world import World

HOVER_LIMIT = 1.0  # [m] from its point that a hover may stray and still be a success
LANDING_LIMITS = (0.30, 0.5, 0.4)  # offset [m], sink and drift [m/s] of a success

HAND_OVER = 0.5  # [s] flown at trim, until every sensor has spoken; then the pilot takes over
PROGRESS_EVERY = 0.1  # [s]
HELD = "held to the end"

Progress = Callable[[float, str, float], None]  # time [s], phase, estimated height [m]
Onlooker = Callable[[World, Sequence[Measurement], Navigator, StateEstimate], None]  # once a step of the loop


class Crew(NamedTuple):
    """Who flies."""

    navigator: Navigator
    pilot: Pilot


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
    shares: dict[str, float]  # of wall_s, by what took it; the renderer's process goes on beside the others
    folder: Path | None


def fly(
    scenario: Scenario,
    *,
    seed: int | tuple[int, ...] = 0,
    folder: Path | str | None = None,
    cameras: bool = True,
    vehicle: Vehicle | None = None,
    aboard: Vehicle | None = None,
    navigator: NavigatorMaker = make_navigator,
    pilot: PilotMaker = make_pilot,
    keep_frames: bool = False,
    name: str = "scenario",
    progress: Progress | None = None,
    onlooker: Onlooker | None = None,
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
        onlooker: sees world, measurements, navigator and state after each update; experiments judge by it.

    Raises:
        UserError: unusable input, or a log that cannot be written any more. SimulationDiverged: the physics left the
            numbers. RenderError: the cameras failed in flight. What a navigator or pilot of one's own raises. Whatever
            it is, the log up to there is kept.
    """
    started = time.perf_counter()
    seeds = np.random.SeedSequence(seed)
    nominal = aboard or vehicles.load(scenario.vehicle)
    flying = vehicle or vehicles.load(scenario.vehicle)

    # BLAS splits its sums by the number of its threads: with one, a flight is the same to the bit wherever it flies
    with threadpool_limits(limits=1), make_world(scenario, seeds, flying, cameras=cameras) as world:
        rehearse(sees=cameras)  # while the renderer gets ready
        equipment = make_equipment(scenario, nominal, world)
        crew = Crew(navigator(equipment, scenario, cameras), pilot(nominal, world.site, scenario, world.trim.heading))
        observer = Observer(world, equipment, HAND_OVER)
        document = {
            "scenario_name": name,
            "seed": seeds.entropy,
            "scenario": scenario,
            "vehicle": flying.document,
            "aboard": nominal.document,
            "versions": versions(),
        }
        if isinstance(world.eyes, RenderProcess):
            try:
                world.eyes.wait()
            except RenderError as error:
                raise UserError(f"{error}; flights without cameras (--no-cameras) need none of it") from error
        recording: Recording = Unrecorded()
        if folder is not None:
            folder = Path(folder)
            recording = FolderRecording(folder, world, equipment, document, keep_frames=keep_frames)
        startup = time.perf_counter() - started

        def concluded(reason: str) -> Flight:
            summary = _judge(scenario, world, crew.pilot, observer, reason)
            watch.lap("logging")
            renderer = world.eyes if isinstance(world.eyes, RenderProcess) else None
            shares = watch.shares()
            if renderer is not None and watch.total:
                shares["renderer process"] = renderer.busy_s / watch.total
            flight = Flight(
                scenario=name,
                seed=(seed,) if isinstance(seed, int) else seed,
                vehicle=flying.name,
                summary=summary,
                wall_s=watch.total,
                startup_s=startup,
                real_time_factor=summary.duration_s / watch.total if watch.total else 0.0,
                renderer=renderer.renderer if renderer is not None else None,
                shares=shares,
                folder=folder,
            )
            recording.conclude(asdict(flight))
            return flight

        watch = Stopwatch()
        with recording:
            try:
                reason = _loop(scenario, world, crew, observer, recording, watch, progress, onlooker)
            except KeyboardInterrupt:
                with suppress(UserError):
                    concluded("interrupted")
                raise
            except Exception as failure:
                # a full disk may be the failure: what ended the flight is the news, not that it cannot be noted
                with suppress(UserError):
                    recording.event(world.t, str(failure), "ERROR")
                    concluded(str(failure))
                raise
            return concluded(reason)


def _judge(scenario: Scenario, world: World, pilot: Pilot, observer: Observer, reason: str) -> Summary:
    """Sum up, and say whether the goal was met."""
    landed = pilot.finished and observer.touchdown is not None and _at_rest(world)
    summary = observer.summary(landed=landed, success=False, reason=reason)
    if scenario.plan.goal == "hover":
        success = reason == HELD and observer.strayed(scenario.plan.point_m) <= HOVER_LIMIT
    else:
        offset, sink, drift = LANDING_LIMITS
        down = observer.touchdown
        success = (
            landed
            and down is not None
            and math.dist((down.east, down.north), _target(scenario, down.t)) <= offset
            and down.sink <= sink
            and down.drift <= drift
        )
    return replace(summary, success=success)


def _target(scenario: Scenario, t: float) -> tuple[float, float]:
    """Where the pilot was to land at time t [s]: the pad, or where the script has sent it since."""
    moves = [event for event in scenario.events if isinstance(event, Target) and event.at_s <= t]
    if not moves:
        return 0.0, 0.0
    east, north = max(moves, key=lambda event: event.at_s).position_m
    return east, north


def _at_rest(world: World) -> bool:
    """On its skids, upright, throttle closed, rotor slowing."""
    return bool(
        world.contact.count > 0
        and world.truth.rotation[2, 2] > math.cos(math.radians(15.0))
        and float(np.linalg.norm(world.truth.velocity)) < 0.1
        and world.controls.throttle < 1e-6
        and world.signals["rotor_acceleration"] < 0.0
    )


def _loop(
    scenario: Scenario,
    world: World,
    crew: Crew,
    observer: Observer,
    recording: Recording,
    watch: Stopwatch,
    progress: Progress | None,
    onlooker: Onlooker | None,
) -> str:
    """Fly until the pilot has finished or time is up; says how it ended."""
    navigator, pilot = crew
    steered = navigator if isinstance(navigator, Steered) else None
    script = Script(scenario)
    controls = world.trim.controls
    told = 0
    next_progress = 0.0
    watch.start()
    while True:
        for happened in script.play(world, pilot):
            recording.event(world.t, happened, "WARN")
        world.step(controls)
        watch.lap("physics")
        measurements = world.measure()
        watch.lap("waiting for pictures")
        state = navigator.update(measurements)
        watch.lap("navigator")
        flown = controls
        if world.t >= HAND_OVER:
            controls = pilot.update(state)
        if steered is not None:
            steered.steer(controls)
        watch.lap("pilot")
        observer.watch(world, state, measurements, navigator.detections)
        recording.step(world, measurements, navigator, state, flown)
        if onlooker is not None:
            onlooker(world, measurements, navigator, state)
        for t, text in pilot.events[told:]:
            recording.event(t, text)
            observer.phase_changed(t, text)
        told = len(pilot.events)
        watch.lap("logging")
        if progress is not None and world.t >= next_progress:
            progress(world.t, str(pilot.phase), float(state.position[2]))
            next_progress = world.t + PROGRESS_EVERY
        if pilot.finished:
            return pilot.events[-1][1] if pilot.events else "finished"
        if world.t >= scenario.duration_s - 1e-9:
            return HELD if scenario.plan.goal == "hover" else "time is up"
