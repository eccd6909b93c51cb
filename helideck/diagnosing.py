"""What `helideck diagnose` does: logs and a vehicle in; verdict, extended vehicle, gain and report out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib import import_module
from itertools import count
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.linalg import block_diag

from flightlog.errors import UserError
from helideck.estimation import find_mapping
from identification import counts, extension, gain, parity
from identification.bench import widened
from identification.closed_loop import Landing
from identification.diagnosis import Diagnosis, examine, open_bench
from identification.intake import sound
from identification.logs import Flights, read
from identification.predictions import predictions
from identification.report import Findings
from identification.report.drivers import visited
from identification.report.unforeseen import at_rest, helicopter
from identification.told import told
from identification.unknown.table import tables
from identification.verdict import NotTestable, Verdict
from identification.widening import covariance
from sim import kinds

STEPS = 6
Progress = Callable[[float, float, str], None]


@dataclass(frozen=True, eq=False)
class Answer:
    """All that a diagnosis came to."""

    verdict: Verdict
    flights: Flights
    heldout: Flights | None
    vehicle: kinds.AnyVehicle | None
    diagnosis: Diagnosis | None  # None without a vehicle
    gain: gain.Gain | None
    extended: kinds.AnyVehicle | None
    folder: Path
    landings: Sequence[Landing] = ()

    @property
    def findings(self) -> Findings:
        """What the report is made of."""
        return Findings(self.verdict, self.diagnosis, self.gain, self.landings, self.flights.tables)

    def document(self) -> dict[str, Any]:
        """The document of `--json`."""
        found = asdict(self.verdict)
        for cause in found["causes"]:
            topic = cause.pop("topic")
            if topic is not None:
                empty = dict.fromkeys(("nominal", "std", "ci95", "unit"))
                cause["parameters"]["topic"] = {"value": topic} | empty
        found["heldout"] = None if self.gain is None else heldout_document(self.gain)
        for key, name in (("report", "report.html"), ("recording", "replay.rrd")):
            found[key] = str(self.folder / name) if (self.folder / name).is_file() else None
        return found


def heldout_document(found: gain.Gain) -> dict[str, Any]:
    """Held-out figures as plain numbers."""
    return {
        "how": found.how,
        "log_likelihood": found.log_likelihood,
        "log_likelihood_ci95": list(found.log_likelihood_ci95),
        "over_all_parameters": found.over_everything,
        "channels": [asdict(c) | {"share_of_explainable": c.share_of_explainable} for c in found.channels],
    }


def diagnose(
    logs: Sequence[Path],
    *,
    folder: Path,
    vehicle: Path | None = None,
    normal: Sequence[Path] = (),
    heldout: Sequence[Path] = (),
    mapping: Path | None = None,
    landings: int = 0,
    progress: Progress = lambda done, of, text: None,
) -> Answer:
    """Diagnose logs and write what comes of it into a folder, which is made.

    Args:
        logs: flight folders, CSV, ULog, DataFlash.
        folder: for extended.toml, diagnosis.json, the report, the recording.
        vehicle: file or name of what flew; None: sensors are judged against each other.
        normal: logs of flights known to be good, to which the vehicle's numbers are fitted first.
        heldout: logs that are used for the gain alone.
        mapping: what a CSV's columns are.
        landings: to fly with the vehicle as it was and as extended.
        progress: told (steps done, steps in all, what is being done).

    Raises:
        UserError: for an unusable log, vehicle or mapping.
    """
    progress(0, STEPS, "reading")
    chosen = find_mapping(mapping)
    flights = read(logs, chosen)
    others = read(heldout, chosen) if heldout else None
    good = read(normal, chosen) if normal else None
    for more in (others, good):
        if more is not None:
            _ = flights + more  # no file may be both
    flown = None if vehicle is None else kinds.load(vehicle)
    flights = sound(flights, flown)
    others, good = (None if more is None else sound(more, flown) for more in (others, good))
    _make(folder)
    if flown is None:
        if good is not None:
            raise UserError("--normal: numbers of a vehicle are fitted to normal flights: name it with --vehicle")
        return _without_model(flights, folder)
    if good is not None:
        progress(1, STEPS, "fitting the vehicle to normal flights")
        flown = import_module("identification.normal").refit_to(flown, good.tables, folder / "nominal.toml")
    progress(2, STEPS, "searching")
    found = examine(flights.tables, flown)
    verdict = _limited(found.verdict, flights)
    verdict = replace(verdict, notes=[*flights.notes, *(others.notes if others else ()), *verdict.notes])
    progress(3, STEPS, "measuring the gain")
    bench = open_bench(others.tables, flown, found.bench) if others is not None else None
    measured = gain.measure(found, bench) if verdict.baseline.certified else None
    made: kinds.AnyVehicle | None = None
    if measured is not None:
        worth = gain.of_each(found, measured, bench) if verdict.causes else {}
        verdict = replace(
            verdict, channels=measured.errors(), predictions=predictions(found, bench),
            causes=[replace(cause, gain=worth.get(cause.name, cause.gain)) for cause in verdict.causes],
        )  # fmt: skip
        if verdict.causes or tables(found.unknown, flown).values:
            progress(4, STEPS, "extending the vehicle")
            made = _extend(found, verdict, flights, folder)
            verdict = replace(verdict, extended_vehicle=str(made.path))
    flights_flown: list[Landing] = []
    if landings and made is not None:
        from helideck.closed_loop import fly_both

        flights_flown = fly_both(found.bench, made, flights, landings)
    if verdict.baseline.certified:
        progress(4.5, STEPS, "recording")
        record(found, measured, folder / "replay.rrd")
    verdict = told(verdict, found.search.causes)
    return Answer(verdict, flights, others, flown, found, measured, made, folder, flights_flown)


def new_folder(log: Path) -> Path:
    """A new folder under diagnoses/, named for the first log."""
    stem = log.resolve().name.partition(".")[0] or "log"
    for number in count(1):
        folder = Path("diagnoses") / (stem if number == 1 else f"{stem}-{number}")
        if not folder.exists():
            return folder
    raise AssertionError


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made: {error.strerror}; name a folder that can") from None


def _without_model(flights: Flights, folder: Path) -> Answer:
    """Redundant sensors against each other, and rigid-body kinematics."""
    verdict = parity.judge(flights.tables)
    verdict = replace(_limited(verdict, flights), notes=[*flights.notes, *verdict.notes])
    return Answer(verdict, flights, None, None, None, None, None, folder)


def _limited(verdict: Verdict, flights: Flights) -> Verdict:
    """Causes that show in timing are not named where rows have no times of their own."""
    if not flights.untimed:
        return verdict
    needs = [f"{topic}.t" for topic in flights.untimed]
    timing = [cause.name for cause in verdict.causes if cause.where == "timing"]
    return replace(
        verdict, causes=[cause for cause in verdict.causes if cause.where != "timing"],
        not_testable=[*verdict.not_testable, *(NotTestable(name, needs) for name in timing)],
    )  # fmt: skip


def record(found: Diagnosis, measured: gain.Gain | None, file: Path) -> None:
    """The most telling flight as measured and as the model has it, as helicopters in one recording."""
    bench = helicopter(found.bench)
    if bench is None:
        return
    from flightlog.replay_pair import write_pair
    from identification.report import tracks
    from sim.shapes import vehicle_meshes

    gained = [0.0] * len(bench.names)
    if measured is not None and measured.judged is found.bench:
        gained = [float(np.sum(item.before**2 - item.after**2)) for item in measured.residuals]
    flight = int(np.argmax(gained))
    own = {p.key for name in found.causes for p in found.search.causes[name].parameters}
    before = tracks.simulated(bench, flight, at_rest(bench, found.search.null, own), "model as it was")
    shown = [tracks.measured(bench, flight), before]
    if found.causes:
        shown.append(tracks.simulated(bench, flight, found.search.fit(found.causes), "extended model"))
    meshes = vehicle_meshes(mujoco.MjModel.from_xml_path(str(bench.vehicle.model)))
    write_pair(file, shown, meshes, None, f"diagnosis of {bench.names[flight]}")


def _extend(found: Diagnosis, verdict: Verdict, flights: Flights, folder: Path) -> kinds.AnyVehicle:
    """Write extended.toml; the vehicle that it makes."""
    names = tuple(sorted(cause.name for cause in verdict.causes if cause.name in found.causes))
    fit, chosen = found.search.fit(names), [found.search.causes[name] for name in names]
    of = {p.key: name for name in names for p in found.search.causes[name].parameters}
    beside, events = tables(found.unknown, found.bench.vehicle), counts.told(verdict.causes, len(found.bench.names))
    delta = extension.Delta(
        values={**fit.values, **beside.values, **{key: value for key, (value, *_) in events.items()}},
        causes=of | dict(beside.of) | {key: cause for key, (_, cause, _, _) in events.items()},
        units={key: found.bench.units[key] for key in of} | dict(beside.units)
        | {key: unit for key, (*_, unit, _) in events.items()},
        covariance=block_diag(
            covariance(chosen, fit, found.bench.nominal, widened(found.bench)), beside.covariance,
            np.diag([std**2 for *_, std in events.values()]),
        ),
        visited=visited(found.bench),
    )  # fmt: skip
    hashes: Mapping[str, str] = {name: extension.digest(log.path) for name, log in flights.logs.items()}
    return extension.write(found.bench.vehicle, delta, hashes, folder / "extended.toml")
