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
from sim.sensors.faults import Dropout, Fault, Spike
from sim.vehicle import Vehicle
from sim.world import STEP, World
from tests.blind.foreign import White
from tests.blind.plans import FlightPlan

Rows = dict[str, list[Sequence[Any]]]
# what the mark and the ranger say of near-by outliers, dropouts and attitude noise
OUTLIERS = {"gps": ("u", 5.0), "baro": ("altitude", 5.0), "sonar": ("range", 1.0), "pad": ("x", 1.0)}
LOST = 0.05
NOISY = 0.004 * 47.0  # [uT]: 4 mrad of the field

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
        write_flight_json(folder, vehicle)


def write_flight_json(folder: Path, vehicle: str) -> None:
    """flight.json, which says no more than what the nominal vehicle is called."""
    write_flight(folder, {"scenario_name": "unknown", "vehicle_name": vehicle})


def stressed(world: World) -> list[Fault]:
    """What a bad day does to any vehicle; needs no cause to be named."""
    world.wind.scale *= 2.0
    faults: list[Fault] = [
        Spike(topic=topic, column=column, size=size, share=0.02) for topic, (column, size) in OUTLIERS.items()
    ]
    faults += [Dropout(topic=topic, share=LOST) for topic in OUTLIERS]
    return [*faults, White("mag", ("mx", "my", "mz"), NOISY)]
