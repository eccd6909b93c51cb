"""Flies for a diagnosis: the scenario of its logs with the vehicle as it was and as extended."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from flightlog.errors import UserError
from identification.bench import Bench
from identification.closed_loop import Landing, compare, measured
from identification.logs import Flights
from identification.report.unforeseen import helicopter
from scenarios.flight import fly
from scenarios.load import load
from scenarios.schema import Scenario
from sim.divergence import SimulationDiverged
from sim.kinds import AnyVehicle
from sim.vehicle import Vehicle

SEED = 70_001  # the first; a log's own would draw the very gusts of the measured flight again


def fly_both(bench: Bench, extended: AnyVehicle, flights: Flights, number: int) -> list[Landing]:
    """Landings as measured, and `number` of each model; the scenario is that of the first flight folder, or `landing`.

    Raises UserError for another kind of vehicle than a helicopter, which alone is flown.
    """
    flown = helicopter(bench)
    if flown is None or not isinstance(extended, Vehicle):
        raise UserError(f"--fly: {bench.vehicle.name} is a {bench.vehicle.document['kind']}; helicopters are flown")
    scenario, aboard = _scenario(flights), flown.vehicle

    def one(vehicle: Vehicle, seed: int) -> Landing:
        try:
            summary = fly(scenario, seed=seed, cameras=False, vehicle=vehicle, aboard=aboard).summary
        except SimulationDiverged:
            return Landing("", "", None, None, None)
        return Landing(
            "", "", summary.touchdown_offset_m, summary.touchdown_sink_m_s, summary.touchdown_drift_m_s
        )  # fmt: skip

    return [*measured(flown), *compare(one, flown.vehicle, extended, range(SEED, SEED + number))]


def _scenario(flights: Flights) -> Scenario:
    for log in flights.logs.values():
        given = log.document.get("scenario")
        if log.kind == "flight" and isinstance(given, Mapping):
            try:
                return Scenario.model_validate(_given(given))
            except ValidationError:
                continue  # of another version
    return load("landing")


def _given(document: Mapping[str, Any]) -> dict[str, Any]:
    """A scenario as a flight keeps it, without the keys that were left open."""
    return {
        key: _given(value) if isinstance(value, Mapping) else value
        for key, value in document.items()
        if value is not None
    }
