"""Who flies: the navigator, designed for the equipment aboard, and the pilot, designed for the vehicle.

Either may be replaced by one's own: `fly(..., navigator=make)` with `make(equipment, scenario, sees)`, and
`fly(..., pilot=make)` with `make(vehicle, site, scenario, heading)`.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Protocol

import cv2
from threadpoolctl import threadpool_limits

import controllers.pilot
from controllers.gains import Gains, design
from controllers.landing import Landing, LandingLimits
from controllers.plant import LinearPlant
from controllers.sequence import Hover
from estimators import navigators
from estimators.navigators import Navigator
from flightlog.atmosphere import density_at
from flightlog.equipment import Equipment
from flightlog.errors import UserError
from flightlog.signals import Controls, StateEstimate
from scenarios.schema import Scenario
from sim.linearisation import linearise, trim
from sim.pipeline import Pipeline
from sim.sensors.contract import Site
from sim.vehicle import Vehicle


class Pilot(Protocol):
    """State in, controls out."""

    @property
    def events(self) -> Sequence[tuple[float, str]]:
        """(t [s], what happened) so far."""
        ...

    @property
    def phase(self) -> str:
        """Where the flight plan stands."""
        ...

    @property
    def finished(self) -> bool:
        """Whether the plan has come to its end."""
        ...

    def update(self, state: StateEstimate) -> Controls:
        """Controls for the period that begins; called at 250 Hz."""
        ...

    def set_target(self, east: float, north: float) -> None:
        """Move the point to be flown to [m] from the pad's centre."""
        ...


PILOTED = ("servo", "engine", "main_rotor", "tail_rotor")  # terms whose numbers the pilot's design takes

NavigatorMaker = Callable[[Equipment, Scenario, bool], Navigator]
PilotMaker = Callable[[Vehicle, Site, Scenario, float], Pilot]


def make_navigator(equipment: Equipment, scenario: Scenario, sees: bool) -> Navigator:
    """The navigator that the scenario names; `sees`: pictures will come. UserError where a sensor is missing."""
    # OpenCV's own threads gain nothing on pictures of this size and disturb the renderer
    cv2.setNumThreads(1)
    return navigators.make(scenario.navigator, equipment, variant=scenario.variant, sees=sees)


def make_pilot(vehicle: Vehicle, site: Site, scenario: Scenario, heading: float) -> Pilot:
    """The pilot for the scenario's plan."""
    plan = scenario.plan
    if plan.heading_deg is not None:
        heading = math.radians(plan.heading_deg)
    east, north, height = plan.point_m
    lands = plan.goal == "land"
    limits = LandingLimits(height=height, steps=tuple(plan.steps_m), step_time=plan.step_s)
    sequence = Landing(site.skid_height, limits) if lands else Hover(height=height)
    sequence.set_target(east, north)
    gains = _gains(vehicle, site.surface_pressure, site.surface_temperature)
    return controllers.pilot.Pilot(gains, sequence, heading)


@lru_cache(maxsize=8)
def _gains(vehicle: Vehicle, surface_pressure: float, surface_temperature: float) -> Gains:
    """Gains for a vehicle's hover in still air; by one thread, so that they are the same to the bit everywhere."""
    with threadpool_limits(limits=1):
        return design(plant_of(vehicle, surface_pressure, surface_temperature))


def plant_of(
    vehicle: Vehicle, surface_pressure: float, surface_temperature: float, height: float = 10.0
) -> LinearPlant:
    """The linear plant of a vehicle's hover in still air at `height` [m], as gain design takes it."""
    for name in PILOTED:
        if name not in vehicle.parameters:
            raise UserError(f"{vehicle.path}: terms.{name}: is missing: the pilot is designed with its numbers")
    pipeline = Pipeline(vehicle.terms, vehicle.parameters, vehicle.geometry)
    try:
        hover = trim(
            pipeline,
            vehicle.inertia,
            height=height,
            surface_pressure=surface_pressure,
            surface_temperature=surface_temperature,
        )
    except ValueError as error:
        raise UserError(f"{vehicle.path}: no pilot can be designed for it: {error}") from error
    model = linearise(pipeline, hover)
    geometry, servo = vehicle.geometry, vehicle.parameters["servo"]
    density = density_at(height, surface_pressure, surface_temperature)
    disc = math.pi * float(geometry["rotor_radius"]) ** 2
    thrust = float(hover.signals["thrust"])
    cyclic, tail = servo["cyclic_max"], servo["tail_max"]
    return LinearPlant(
        A=model.A,
        B=model.B,
        state_names=model.state_names,
        input_names=model.input_names,
        delay=model.delay,
        trim=hover.controls,
        trim_roll=hover.roll,
        trim_pitch=hover.pitch,
        lower=Controls(servo["collective_min"], -cyclic, -cyclic, -tail, 0.0),
        upper=Controls(servo["collective_max"], cyclic, cyclic, tail, 1.0),
        rotor_speed=float(geometry["nominal_speed"]),
        tail_pitch=vehicle.parameters["tail_rotor"]["trim"] - float(geometry["rotor_direction"]) * hover.controls.tail,
        rotor_radius=float(geometry["rotor_radius"]),
        induced_velocity=math.sqrt(thrust / (2.0 * density * disc)),
        hub_height=float(geometry["hub"][2]),
        skid_height=float(geometry["skid_height"]),
    )
