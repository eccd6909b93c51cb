"""What a diagnosis takes in: a flight's tables made sound, or refused in one line with what would be right."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pyarrow as pa

from flightlog.errors import UserError
from flightlog.tables import Table
from identification.intake import axes, clocks, heights, motion
from identification.intake.rows import REACH, cleaned
from identification.logs import Flights
from identification.parity import alignment
from identification.parity.series import collect
from sim.kinds import AnyVehicle
from sim.vehicle import Vehicle

__all__ = ["sound"]

NEEDED: Mapping[str, tuple[str, ...]] = {"helicopter": ("imu", "controls", "rotor")}
LONGEST: Mapping[str, float] = {"helicopter": 120.0, "multirotor": 600.0, "rig": 600.0}  # [s] of a flight looked at
MARK = ("std_x", "std_y", "std_z")
ECHO = 0.98  # of a ranger's reach, beyond which it has heard nothing


def sound(flights: Flights, vehicle: AnyVehicle | None) -> Flights:
    """Flights whose rows can be trusted so far as they can be checked; UserError for what cannot be used.

    What is left out of a flight stands in the notes.
    """
    notes = list(flights.notes)
    tables = {name: _sound(name, own, vehicle, notes) for name, own in flights.tables.items()}
    # what is not looked at need not be kept
    logs = {name: replace(log, tables=MappingProxyType(tables[name])) for name, log in flights.logs.items()}
    return replace(flights, logs=logs, tables=tables, notes=tuple(dict.fromkeys(notes)))


def _sound(name: str, tables: Mapping[str, Table], vehicle: AnyVehicle | None, notes: list[str]) -> dict[str, Table]:
    kind = None if vehicle is None else str(vehicle.document["kind"])
    needed = NEEDED.get(kind or "", ())
    kept: dict[str, Table] = {}
    for topic in needed:
        if topic not in tables:
            clock = f"{name.partition('#')[0]}: the clock of"
            why = [note.partition(": ")[2] for note in notes if note.startswith(clock) and topic in note]
            reason = why[0] if why else f"has no topic {topic}"
            raise UserError(f"{name}: {reason}: a {kind} needs {', '.join(needed)}")
    if kind is not None and kind in LONGEST and tables:
        tables = clocks.not_too_long(name, tables, LONGEST[kind], notes)
    if isinstance(vehicle, Vehicle):
        axes.sticks(name, tables, vehicle)
    for topic, table in tables.items():
        lacking = [c for c in REACH.get(topic, ()) if topic in needed and not _says(table, c)]
        if lacking:
            wanted = ", ".join(REACH[topic])
            raise UserError(f"{name}: {topic} lacks {', '.join(lacking)}: a {kind} needs {wanted} of it")
        found, said = cleaned(table, each=vehicle is not None)
        if found is None and topic in needed:
            raise UserError(f"{name}: {'; '.join(said)}; a {kind} cannot be judged without it")
        notes += [f"{name}: {line}" for line in said]
        if found is not None:
            kept[topic] = found
    if vehicle is None or not kept:
        return clocks.together(name, kept, (), notes) if kept else kept
    kept = clocks.together(name, kept, needed, notes)
    kept = clocks.unbroken(name, kept, needed, notes)
    helicopter = vehicle if isinstance(vehicle, Vehicle) else None
    if helicopter is not None and "imu" in kept:
        _completed(name, kept, helicopter, notes)
    if kind != "rig":
        axes.check(name, kept, helicopter, notes)
        motion.check(name, kept)
        _heights(name, kept, notes)
    return kept


def _says(table: Table, column: str) -> bool:
    return column in table and bool(np.isfinite(np.asarray(table[column], float)).any())


def _completed(name: str, tables: dict[str, Table], vehicle: Vehicle, notes: list[str]) -> None:
    """What a topic may lack, from what it has; else the topic is left out."""
    sonar = tables.get("sonar")
    if sonar is not None and "valid" not in sonar and "sonar" in vehicle.sensors:
        reach = vehicle.sensors["sonar"].numbers["greatest_range"]
        heard = np.nan_to_num(np.asarray(sonar["range"], float), nan=np.inf) < ECHO * reach
        tables["sonar"] = Table("sonar", sonar.arrow.append_column("valid", pa.array(heard)), sonar.topic)
        notes.append(f"{name}: sonar has no column valid; echoes nearer than {ECHO * reach:.2f} m are taken for heard")
    lacking = [c for c in MARK if "pad" in tables and not _says(tables["pad"], c)]
    if lacking:
        notes.append(f"{name}: pad lacks {', '.join(lacking)}, without which it has no weight; left out")
        del tables["pad"]
    for topic, columns in REACH.items():
        lacking = [c for c in columns if topic in tables and not _says(tables[topic], c)]
        if lacking and topic in tables:
            notes.append(f"{name}: {topic} lacks {', '.join(lacking)}; left out")
            del tables[topic]


def _heights(name: str, tables: dict[str, Table], notes: list[str]) -> None:
    """Heights against each other: sign, unit, clock; what is of another clock or flight is left out."""
    heights.check(name, tables)
    found = collect(tables)
    alignment.check(name, found)
    late, _ = alignment.offset(found)
    if late is not None:
        either = " or ".join((late.topic, *late.others))
        if late.others:
            raise UserError(
                f"{name}: the clocks of {either} are {abs(late.delay):.1f} s apart; one clock would be right, set it "
                "right or leave one out"
            )
        notes.append(f"{name}: the clock of {late.topic} is off by {late.delay:+.1f} s; left out")
        del tables[late.topic]
    else:
        apart = alignment.strangers(found)
        if apart is not None:
            raise UserError(
                f"{name}: {apart[0]} and {apart[1]} do not move together: swapped, of another flight, or one of them "
                "broken; leave one out"
            )
