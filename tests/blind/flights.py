"""Flies a plan and keeps what was measured, nothing else."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from flightlog.flight_json import write_flight
from flightlog.recorder import Recorder
from flightlog.signals import Measurement
from scenarios.flight import fly
from scenarios.logbook import TOPICS
from scenarios.schema import WeatherTable
from sim.sensors.faults import Fault
from sim.vehicle import Vehicle
from sim.world import STEP, World
from tests.blind.plans import FlightPlan

Rows = dict[str, list[Sequence[Any]]]
Tampering = Callable[[World], Iterable[Fault]]  # at the flight's first step: may change the world, gives faults


def measured(
    plan: FlightPlan,
    flies: Vehicle,
    aboard: Vehicle,
    *,
    seed: int,
    weather: WeatherTable | None = None,
    tampering: Sequence[Tampering] = (),
) -> Rows:
    """Rows by topic of one flight of `plan`; the pilot and the navigator are those of `aboard`."""
    rows: Rows = {topic: [] for topic in (*TOPICS.values(), "controls")}

    def look(world: World, measurements: Sequence[Measurement], *_: Any) -> None:
        if not rows["controls"]:  # the first step
            for tamper in tampering:
                for fault in tamper(world):
                    world.add_fault(fault)
        for sample in measurements:
            if type(sample) in TOPICS:
                rows[TOPICS[type(sample)]].append(tuple(sample))  # type: ignore[arg-type]
        rows["controls"].append((world.t - STEP, *world.controls))

    fly(
        plan.scenario(aboard.name, weather), seed=seed, cameras=False, vehicle=flies, aboard=aboard,
        pilot=plan.pilot, name=plan.name, onlooker=look,
    )  # fmt: skip
    return rows


def write(
    rows: Mapping[str, Sequence[Sequence[Any]]], folder: Path, vehicle: str, without: Collection[str] = ()
) -> None:
    """A flight folder with measured/ alone; its flight.json says nothing of what flew."""
    with Recorder(folder) as recorder:
        for topic, of in rows.items():
            if topic not in without:
                writer = recorder.topic("measured", topic)
                for row in sorted(of, key=lambda row: row[0]):
                    writer.append(row)
        write_flight(folder, {"scenario_name": "unknown", "vehicle_name": vehicle})
