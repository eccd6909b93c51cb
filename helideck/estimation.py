"""What `helideck estimate` does: a log of any kind in, a navigator over it, the state and how wrong it is out."""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assets
from estimators import navigators
from estimators.log_equipment import fit
from estimators.log_samples import KINDS
from estimators.navigators import Variant
from estimators.offline import Run, run
from flightlog import toml_file
from flightlog.equipment import Equipment
from flightlog.errors import UserError
from flightlog.readers import Log, read_flight, read_log
from flightlog.rotations import to_angles
from flightlog.tables import Table
from scenarios.schema import Scenario
from scenarios.staging import PADS
from sim import vehicle as vehicles
from sim.vehicle import Vehicle
from sim.world import MAGNETIC_FIELD

Floats = NDArray[np.float64]

DEFAULT_VEHICLE = "raptor90"  # whose sensors stand in for unknown ones
SETTLED = 0.5  # [s] after the beginning, from when on errors count
KNOWN = 50.0  # [m] a height less sure than this is none
AXES = ("e", "n", "u", "ve", "vn", "vu", "roll", "pitch", "heading")
SITE = (101_325.0, 288.15)  # pressure [Pa] and temperature [K]: heights come from the log, not from these


@dataclass(frozen=True)
class Spread:
    """Of one axis: mean and largest absolute error, standard deviation and root mean square of the signed one, SI."""

    mean: float
    max: float
    std: float
    rmse: float


@dataclass(frozen=True, eq=False)
class Estimation:
    """What was estimated from a log."""

    log: Log
    navigator: str
    variant: str
    run: Run
    missing: tuple[str, ...]
    errors: Mapping[str, Spread] | None  # by axis; None where the log has nothing to judge by
    judged_by: str | None

    @property
    def height(self) -> tuple[float, float] | None:
        """Least and greatest height [m]; None where it was never known."""
        table = self.run.estimate
        known = table["u"][table["std_u"] < KNOWN]
        return (float(known.min()), float(known.max())) if len(known) else None

    def document(self, file: Path | None) -> dict[str, Any]:
        """The document of `--json`; `file`: where the series is."""
        height = self.height
        return {
            "log": str(self.log.path),
            "navigator": self.navigator,
            "variant": self.variant,
            "topics_used": list(self.run.used),
            "topics_missing": list(self.missing),
            "duration_s": self.log.duration,
            "rejected": dict(self.run.rejected),
            "height": None if height is None else {"min_m": height[0], "max_m": height[1]},
            "errors": None if self.errors is None else {axis: asdict(spread) for axis, spread in self.errors.items()},
            "judged_by": self.judged_by,
            "notes": list(self.log.notes),
            "estimate": None if file is None else str(file),
        }


def find_mapping(name: Path | None) -> Path | None:
    """A mapping's file, or one that comes with the project by its name; UserError where there is none."""
    if name is None or name.is_file():
        return name
    ours = sorted(path.stem for path in assets.path("mappings").glob("*.toml"))
    if name.suffix == "" and name.name in ours:
        return assets.path("mappings", f"{name}.toml")
    raise UserError(f"{name}: no such mapping file; {toml_file.nearest(name.stem, ours)}")


def estimate(
    path: Path,
    *,
    vehicle: Path | None = None,
    mapping: Path | None = None,
    navigator: str = "helideck",
    variant: Variant = "helideck",
    progress: Callable[[float, float], None] | None = None,
) -> Estimation:
    """Run a navigator over a log.

    Args:
        path: a flight folder, CSV, ULog or DataFlash.
        vehicle: file of the vehicle that logged it; None: the one a flight folder names, else sensors of usual kinds.
        mapping: what a CSV's columns are.
        navigator: by name.
        variant: "helideck" or "published".
        progress: told how much of the log is done and how long it is [s].

    Raises:
        UserError: for an unusable log, vehicle or mapping, or a navigator that cannot do without what is missing.
    """
    log = read_log(path, find_mapping(mapping))
    equipment = _equipment(log, vehicle)
    segments = [log.segment(index) for index in range(len(log.segments))]
    pictures = log.path / "measured" if log.kind == "flight" and "frames" in log.tables else None
    if "imu" not in log.tables and (navigator, variant) != ("helideck", "helideck"):
        raise UserError(f"{path}: the navigator {navigator!r} ({variant}) cannot do without an imu, and there is none")
    first = log.segments[0][0]
    found = run(
        segments,
        equipment,
        lambda: navigators.make(navigator, equipment, variant=variant, sees=pictures is not None),
        pictures=pictures,
        progress=None if progress is None else lambda t: progress(max(0.0, t - first), log.duration),
    )
    judge, by = _judge(log)
    return Estimation(
        log=log,
        navigator=navigator,
        variant=variant,
        run=found,
        missing=tuple(topic for topic in KINDS if topic not in log.tables),
        errors=None if judge is None else errors(found.estimate, judge),
        judged_by=by if judge is not None else None,
    )


def write(estimation: Estimation, folder: Path) -> Path:
    """Write the series as `estimate.parquet` into a folder, which is made; where it is."""
    file = folder / "estimate.parquet"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        pq.write_table(estimation.run.estimate.arrow, file, compression="zstd")
    except OSError as error:
        raise UserError(f"{file}: cannot be written: {error.strerror or error}") from None
    return file


def new_folder(log: Path) -> Path:
    """A new folder under estimates/, named for the log."""
    stem = log.name.partition(".")[0] or "log"
    for number in count(1):
        folder = Path("estimates") / (stem if number == 1 else f"{stem}-{number}")
        if not folder.exists():
            return folder
    raise AssertionError


def errors(table: Table, judge: Table) -> dict[str, Spread]:
    """Errors by axis of an estimate against a reference or the truth, from SETTLED on, where both are known."""
    found = {}
    t, own = table["t"], judge["t"]
    columns = _with_angles(judge)
    inside = (t >= max(own[0], t[0] + SETTLED)) & (t <= own[-1])
    for axis in AXES:
        values = columns.get(axis)
        if values is None or axis not in table:
            continue
        sound = np.isfinite(values)
        if np.count_nonzero(sound) < 2 or not inside.any():
            continue
        right = np.unwrap(values[sound]) if axis == "heading" else values[sound]
        wrong = table[axis][inside] - np.interp(t[inside], own[sound], right)
        if axis == "heading":
            wrong = (wrong + math.pi) % (2.0 * math.pi) - math.pi
        wrong = wrong[np.isfinite(wrong)]
        if len(wrong):
            size = np.abs(wrong)
            found[axis] = Spread(
                float(size.mean()), float(size.max()), float(wrong.std()), float(np.sqrt(np.mean(wrong**2)))
            )
    return found


def _with_angles(judge: Table) -> dict[str, Floats]:
    """A reference's columns by axis; angles from its quaternion where it has one instead."""
    columns = {axis: judge[axis].astype(float) for axis in AXES if axis in judge}
    if "roll" not in columns and all(name in judge for name in ("qw", "qx", "qy", "qz")):
        q = judge.stack("qx", "qy", "qz", "qw")
        sound = np.isfinite(q).all(axis=1) & (np.linalg.norm(q, axis=1) > 1e-6)
        for axis in ("roll", "pitch", "heading"):
            columns[axis] = np.full(len(q), math.nan)
        if sound.any():
            for axis, values in zip(("roll", "pitch", "heading"), to_angles(Rotation.from_quat(q[sound])), strict=True):
                columns[axis][sound] = values
    return columns


def _judge(log: Log) -> tuple[Table | None, str | None]:
    """What the estimate is held against: the truth of a simulated flight, else the log's reference."""
    if len(log.segments) > 1:
        return None, None
    if log.kind == "flight" and (log.path / "truth").is_dir() and log.document:
        truth = read_flight(log.path).truth
        if "state" in truth:
            return truth["state"], "truth/state"
    return (log.tables["reference"], "reference") if "reference" in log.tables else (None, None)


def _equipment(log: Log, vehicle: Path | None) -> Equipment:
    """The sensors as known aboard: of the vehicle that is named, that flew, or of usual kinds as the log shows them."""
    known = _aboard(log) if vehicle is None else vehicles.load(vehicle)
    if known is not None:
        equipment = known.equipment(_mark(log), known.site(*SITE, MAGNETIC_FIELD))
        if log.kind == "flight":
            return equipment
        fitted = fit(log.tables, equipment, declination=_declination(log))
        sensors = {topic: replace(spec, rate=fitted.sensors[topic].rate) if topic in fitted.sensors else spec
                   for topic, spec in equipment.sensors.items()}  # fmt: skip
        return replace(equipment, sensors=sensors, magnetic_field=fitted.magnetic_field)
    usual = vehicles.load(DEFAULT_VEHICLE)
    return fit(log.tables, usual.equipment(None, usual.site(*SITE, MAGNETIC_FIELD)), declination=_declination(log))


def _aboard(log: Log) -> Vehicle | None:
    """The vehicle that a flight's navigator was designed for."""
    document = log.document.get("aboard")
    return vehicles.from_document(document, log.path / "flight.json") if isinstance(document, Mapping) else None


def _mark(log: Log) -> Any:
    """The mark of a flight's scenario."""
    scenario = log.document.get("scenario")
    pad = scenario.get("pad") if isinstance(scenario, Mapping) else Scenario.model_fields["pad"].default
    return PADS.get(str(pad))


def _declination(log: Log) -> float:
    """[rad] of the magnetic field, where the log's parameters tell it."""
    parameters = log.document.get("parameters")
    value = parameters.get("COMPASS_DEC", 0.0) if isinstance(parameters, Mapping) else 0.0
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else 0.0
