"""Sets the stage of a scenario: the world with its vehicle, weather, sensors and cameras, before anybody flies."""

import math
from dataclasses import replace

import numpy as np

from flightlog.equipment import Equipment
from flightlog.marks import HMark, Mark, RingMark
from scenarios import cameras as camera_tables
from scenarios.checks import check
from scenarios.events import sensor_numbers
from scenarios.schema import SENSOR_TABLES, Scenario
from sim.cameras.rendering import RenderProcess
from sim.randomness import generator
from sim.vehicle import Vehicle
from sim.weather import Weather
from sim.world import Start, World

PADS: dict[str, Mark | None] = {"h": HMark(), "ring": RingMark(), "none": None}


def make_world(scenario: Scenario, seeds: np.random.SeedSequence, vehicle: Vehicle, *, cameras: bool) -> World:
    """The world at t = 0; cameras: rendered pictures, else the pad camera's error model in their place."""
    fitted = camera_tables.fitted(vehicle.cameras, scenario.cameras)
    check(scenario, vehicle, fitted, rendered=cameras)
    imaging = camera_tables.imaging(fitted, scenario.cameras)
    noise_seed = int(generator(seeds, "cameras").integers(2**31))
    tables = {topic: getattr(scenario.sensors, topic) for topic in SENSOR_TABLES}
    return World(
        vehicle,
        weather=expected_weather(scenario, vehicle),
        light=scenario.light.light(),
        scene=scenario.scene,
        dip=scenario.horizon_dip,
        mark=PADS[scenario.pad],
        start=_start(scenario, seeds),
        seeds=seeds,
        cameras=fitted,
        eyes=(lambda scene: RenderProcess(scene, imaging, noise_seed)) if cameras else None,
        sensor_numbers={topic: sensor_numbers(topic, table.model_dump()) for topic, table in tables.items()},
    )


def make_equipment(scenario: Scenario, aboard: Vehicle, world: World) -> Equipment:
    """What the navigator is told: the sensors as fitted to the vehicle `aboard`, and what was read on the pad."""
    pressure, temperature = world.pad_reading
    site = replace(world.site, surface_pressure=pressure, surface_temperature=temperature)
    return replace(aboard.equipment(PADS[scenario.pad], site), horizon_dips=scenario.horizon_dip)


def expected_weather(scenario: Scenario, vehicle: Vehicle) -> Weather:
    """The scenario's; where it says nothing of the wind and the vehicle file knows one, that."""
    weather, said = scenario.weather.weather(), scenario.weather.model_fields_set
    east, north, shear = vehicle.wind
    if (east or north) and not said & {"wind_m_s", "wind_from_deg"}:
        blows = math.hypot(east, north)
        weather = replace(weather, wind=blows, wind_from=math.atan2(-east, -north) % (2.0 * math.pi))
    return weather if "wind_shear" in said else replace(weather, shear=shear)


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
