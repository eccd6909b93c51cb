"""The script of a scenario, carried out on the world and the pilot when its time comes."""

import math
from dataclasses import replace
from typing import Any

from scenarios.schema import (
    SENSOR_TABLES,
    Dropout,
    Event,
    FaultEvent,
    Gust,
    LightChange,
    Scenario,
    Target,
    WindChange,
)
from sim import wind
from sim.sensors import CATALOGUE as SENSORS
from sim.sensors.faults import column_fault
from sim.world import World

# the mark is seen by the down camera, or by the error model in its place: one goes with the other
_TWINS = dict.fromkeys(("down", "pad", "flow"), ("down", "pad", "flow"))


def sensor_numbers(topic: str, keys: dict[str, Any]) -> dict[str, float]:
    """Scenario keys of a sensor (`latency_s`) as its own names (`latency`), SI; what is None is left out."""
    names = {parameter.scenario_key: parameter.name for parameter in SENSORS[topic].PARAMETERS}
    return {names[key]: float(value) for key, value in keys.items() if value is not None}


class Script:
    """Events in the order of their times."""

    def __init__(self, scenario: Scenario) -> None:
        self._events = sorted(scenario.events, key=lambda event: event.at_s)
        self._changed: list[tuple[float, str, dict[str, float]]] = []  # until when, topic, numbers in force
        self._sound: dict[str, dict[str, float]] = {}  # by topic, those numbers before any of it

    def play(self, world: World, pilot: Any) -> list[str]:
        """Carry out what is due at the world's time; says what happened."""
        if not self._events and not self._changed:
            return []
        done = []
        while self._events and self._events[0].at_s <= world.t:
            done.append(self._carry_out(self._events.pop(0), world, pilot))
        over = {topic for until, topic, _ in self._changed if until <= world.t}
        self._changed = [change for change in self._changed if change[0] > world.t]
        for topic in over:
            self._set_numbers(topic, world)
        return done

    def _set_numbers(self, topic: str, world: World) -> None:
        """The sound numbers, and over them what is in force; the later change where two are."""
        numbers = dict(self._sound[topic])
        for _, changed, values in self._changed:
            if changed == topic:
                numbers |= values
        world.set_numbers(topic, numbers)

    def _carry_out(self, event: Event, world: World, pilot: Any) -> str:
        match event:
            case Gust():
                gust = wind.Gust(
                    start=world.t,
                    duration=event.for_s,
                    speed=event.speed_m_s,
                    wind_from=math.radians(event.from_deg),
                    up=event.up_m_s,
                )
                world.add_gust(gust)
                return f"gust of {event.speed_m_s:g} m/s from {event.from_deg:g} deg for {event.for_s:g} s"
            case Dropout():
                for device in _TWINS.get(event.sensor, (event.sensor,)):
                    world.silence(device, world.t + event.for_s)
                return f"{event.sensor} lost for {event.for_s:g} s"
            case FaultEvent():
                return self._fault(event, world)
            case WindChange():
                world.set_wind(event.wind_m_s, math.radians(event.wind_from_deg))
                return f"wind {event.wind_m_s:g} m/s from {event.wind_from_deg:g} deg"
            case LightChange():
                light = world.light
                if event.sun_elevation_deg is not None:
                    light = replace(light, sun_elevation=math.radians(event.sun_elevation_deg))
                if event.strength is not None:
                    light = replace(light, strength=event.strength)
                world.set_light(light)
                return f"sun at {math.degrees(light.sun_elevation):.0f} deg, strength {light.strength:g}"
            case Target():
                pilot.set_target(*event.position_m)
                return f"target moved to {event.position_m[0]:g} m east, {event.position_m[1]:g} m north"
        raise AssertionError(event)

    def _fault(self, event: FaultEvent, world: World) -> str:
        if event.numbers and event.sensor in SENSOR_TABLES:
            changed = sensor_numbers(event.sensor, event.numbers)
            sound = self._sound.setdefault(event.sensor, {})
            sound |= world.numbers(event.sensor, changed.keys() - sound.keys())
            self._changed.append((world.t + event.for_s, event.sensor, changed))
            self._set_numbers(event.sensor, world)
        if event.fault is not None and event.column is not None:
            span = {"start": world.t, "end": world.t + event.for_s}
            size = {"size": event.size, "share": event.share}
            world.add_fault(column_fault(event.fault, event.sensor, event.column, **span, **size))
        what = event.fault or ", ".join(f"{key} = {value:g}" for key, value in event.numbers.items())
        return f"fault of {event.sensor}: {what} for {event.for_s:g} s"


