"""What can only be checked once scenario and vehicle are both known: each fault is one clear line before the flight."""

import math
from collections.abc import Mapping

from flightlog.equipment import CameraSpec
from flightlog.errors import UserError
from flightlog.toml_file import nearest
from scenarios.schema import SENSOR_TABLES, Dropout, FaultEvent, Scenario
from sim.cameras.optics import pinhole_behind
from sim.cameras.rendering import SLOTS
from sim.schedule import period_in_ticks
from sim.vehicle import Vehicle
from sim.world import EYES

CAMERAS = ("down", "forward_a", "forward_b")


def check(scenario: Scenario, vehicle: Vehicle, cameras: Mapping[str, CameraSpec], *, rendered: bool) -> None:
    """Raise UserError where the scenario asks for what this vehicle does not have, or what cannot be flown.

    cameras: those that fly, the scenario's changes included; rendered: they make pictures.
    """
    _check_cameras(scenario, cameras, rendered)
    _check_sensors(scenario, vehicle)
    _check_events(scenario, vehicle, cameras, rendered)
    if scenario.plan.goal == "land" and any(scenario.plan.point_m[:2]):
        east, north, _ = scenario.plan.point_m
        raise UserError(
            f"plan.point_m: a landing's point lies over the pad, which is at 0, 0 (got {east:g}, {north:g}); to begin "
            "elsewhere set start.position_m, to land elsewhere script an event of kind target"
        )
    if scenario.pad != "none" and "down" not in cameras:
        raise UserError(f'{vehicle.path}: cameras.down: is missing: the pad is seen by it; or set pad = "none"')


def _check_cameras(scenario: Scenario, cameras: Mapping[str, CameraSpec], rendered: bool) -> None:
    for name in CAMERAS:
        if name in scenario.cameras.model_fields_set and name not in cameras:
            raise UserError(f"cameras.{name}: this vehicle has no such camera; {nearest(name, cameras)}")
    under_way = 0
    for name, spec in cameras.items():
        _divides(spec.rate, f"cameras.{name}.rate_hz")
        under_way += math.ceil(spec.rate * spec.latency) + 1
        try:
            pinhole_behind(spec.model)
        except ValueError as error:
            raise UserError(f"cameras.{name}.distortion: {error}") from None
    if rendered and under_way > SLOTS:
        raise UserError(
            f"cameras: {under_way} pictures would be under way at a time, by their rates and latencies; "
            f"at most {SLOTS} would be right"
        )


def _check_sensors(scenario: Scenario, vehicle: Vehicle) -> None:
    for topic in SENSOR_TABLES:
        table = getattr(scenario.sensors, topic)
        if table.model_fields_set and topic not in vehicle.sensors:
            raise UserError(f"sensors.{topic}: this vehicle has no such sensor; {nearest(topic, vehicle.sensors)}")
        rate = getattr(table, "rate_hz", None)
        if topic in EYES and {"rate_hz", "latency_s"} & table.model_fields_set:
            text = "rate and latency are the down camera's: set cameras.down.rate_hz, latency_s"
            raise UserError(f"sensors.{topic}: {text}")
        if topic in vehicle.sensors:
            fitted = vehicle.sensors[topic].numbers["rate"] if topic not in EYES else 1.0
            _divides(fitted if rate is None else rate, f"sensors.{topic}.rate_hz")


def _check_events(scenario: Scenario, vehicle: Vehicle, cameras: Mapping[str, CameraSpec], rendered: bool) -> None:
    for number, event in enumerate(scenario.events):
        if not isinstance(event, Dropout | FaultEvent):
            continue
        devices = [*vehicle.sensors, *cameras]
        if event.sensor not in devices:
            raise UserError(
                f"events.{number}.sensor: this vehicle has no {event.sensor!r}; {nearest(event.sensor, devices)}"
            )
        eye = "flow" if scenario.pad == "none" else "pad"
        if isinstance(event, FaultEvent) and event.sensor in EYES and event.sensor != eye:
            raise UserError(
                f"events.{number}.sensor: {event.sensor} is not there with pad = {scenario.pad!r}: the down camera "
                f"looks for the mark, or without one at the ground; {eye!r} would be right"
            )
        if isinstance(event, FaultEvent) and event.sensor in EYES and rendered:
            what = "the pad's sightings" if event.sensor == "pad" else "the flow"
            raise UserError(
                f"events.{number}: faults of {what} need flights without cameras, where an error model "
                "makes them; [cameras.down] and events of kind light or dropout disturb the pictures themselves"
            )


def _divides(rate: float, key: str) -> None:
    """A rate has to be one that the physics can keep."""
    period_in_ticks(rate, key)
