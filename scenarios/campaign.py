"""Monte Carlo: many flights of one scenario, each with a seed of its own.

Run k of campaign c flies with the seed (c, k), whichever worker flies it. Finished runs are kept in parts that are
written whole or not at all, so a killed campaign goes on where it stopped. A run that fails is a row with its error.
"""

import hashlib
import json
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from scipy.stats import binomtest

from flightlog.errors import UserError
from flightlog.flight_json import dumps, plain
from scenarios.flight import Flight, fly
from scenarios.schema import Scenario
from scenarios.summary import Summary
from sim import vehicle as vehicles

RUNS_A_PART = 5
_PART = re.compile(r"runs-(\d+)-(\d+)\.parquet")
# of the machine, not of the flight: kept apart, so that runs.parquet is the same for any number of workers
TIMING = ("wall_s", "startup_s", "real_time_factor")


@dataclass(frozen=True)
class Campaign:
    """What is flown over and over."""

    name: str
    scenario: Scenario
    seed: int
    vehicle: Path | str  # file of what flies
    vehicle_settings: Mapping[str, Any]
    aboard: Path | str
    cameras: bool = False

    def fingerprint(self) -> str:
        """Changes with anything that changes a flight."""
        document = {
            **asdict(self), "scenario": self.scenario.model_dump(mode="json"),
            "vehicle": vehicles.load(self.vehicle, self.vehicle_settings).document,
            "aboard": vehicles.load(self.aboard).document,
        }  # fmt: skip
        return hashlib.sha256(json.dumps(plain(document), sort_keys=True).encode()).hexdigest()[:16]


def run_campaign(
    campaign: Campaign, runs: int, folder: Path, *, workers: int, progress: Callable[[int, int], None] | None = None
) -> pa.Table:
    """Fly what is missing of `runs` runs and write runs.parquet; returns its table, sorted by run.

    progress: called with (runs done, runs in all). Raises UserError where the folder holds another campaign.
    """
    from joblib import Parallel, delayed, parallel_config

    parts = _open(folder, campaign)
    done = _finished(parts)
    missing = [run for run in range(runs) if run not in done]
    chunks = [missing[first : first + RUNS_A_PART] for first in range(0, len(missing), RUNS_A_PART)]
    finished = runs - len(missing)
    if progress is not None:
        progress(finished, runs)
    with parallel_config("loky", inner_max_num_threads=1):
        results = Parallel(n_jobs=min(workers, max(len(chunks), 1)), return_as="generator_unordered", batch_size=1)(
            delayed(_fly_part)(campaign, chunk, parts) for chunk in chunks
        )
        for count in results:
            finished += count
            if progress is not None:
                progress(finished, runs)
    return _gather(parts, folder, runs)


def _open(folder: Path, campaign: Campaign) -> Path:
    """The folder of the parts; its manifest says what campaign it belongs to."""
    manifest = folder / "campaign.json"
    parts = folder / "parts"
    fingerprint = campaign.fingerprint()
    if folder.exists() and not folder.is_dir():
        raise UserError(f"{folder}: a file is in the way; name a folder that is new or empty")
    if manifest.is_file():
        try:
            known = dict(json.loads(manifest.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError) as error:
            raise UserError(f"{manifest}: cannot be read: {error}; name a folder that is new") from None
        if known.get("fingerprint") != fingerprint:
            raise UserError(
                f"{folder}: holds another campaign ({known.get('name')}, seed {known.get('seed')}, or other settings); "
                "name a folder that is new, or the same campaign to go on with it"
            )
    elif folder.exists() and any(folder.iterdir()):
        raise UserError(f"{folder}: not empty and no campaign; name a folder that is new or empty")
    try:
        parts.mkdir(parents=True, exist_ok=True)
        document = {
            "name": campaign.name, "seed": campaign.seed, "fingerprint": fingerprint, "cameras": campaign.cameras,
            "scenario": campaign.scenario, "vehicle": str(campaign.vehicle), "aboard": str(campaign.aboard),
        }  # fmt: skip
        manifest.write_text(dumps(document) + "\n", encoding="utf-8")
    except OSError as error:
        raise UserError(f"{folder}: cannot be written: {error.strerror}") from None
    return parts


def _finished(parts: Path) -> set[int]:
    """Runs that some part holds."""
    return {run for path in parts.iterdir() if _PART.fullmatch(path.name) for run in _runs_of(path)}


def _runs_of(path: Path) -> list[int]:
    return [int(run) for run in pq.read_table(path, columns=["run"])["run"].to_pylist()]


def _fly_part(campaign: Campaign, runs: list[int], parts: Path) -> int:
    """Fly these runs and keep them; how many they were."""
    rows = [fly_run(campaign, run) for run in runs]
    path = parts / f"runs-{runs[0]:06d}-{runs[-1]:06d}.parquet"
    draft = path.with_suffix(f".part{os.getpid()}")
    pq.write_table(pa.Table.from_pylist(rows, schema=SCHEMA), draft, compression="zstd")
    os.replace(draft, path)
    return len(rows)


def fly_run(campaign: Campaign, run: int) -> dict[str, Any]:
    """One row: all of `land --json`, or the error that ended it."""
    row: dict[str, Any] = {"run": run, "seed": f"{campaign.seed}:{run}", "error": None}
    try:
        flight = fly(
            campaign.scenario,
            seed=(campaign.seed, run),
            cameras=campaign.cameras,
            vehicle=vehicles.load(campaign.vehicle, campaign.vehicle_settings),
            aboard=vehicles.load(campaign.aboard),
            name=campaign.name,
        )
    except UserError:
        raise  # unusable input fails every run alike
    except Exception as error:  # a bad run is a row of the campaign, not its end
        return {**row, "error": f"{type(error).__name__}: {error}", "success": False, "landed": False}
    return row | flight_row(flight)


def flight_row(flight: Flight) -> dict[str, Any]:
    """A flight as one flat row."""
    figures = asdict(flight.summary)
    sensors = figures.pop("sensor_height_error_m")
    flat = {
        f"{name}_height_{statistic}_error_m": (errors or {}).get(statistic)
        for name, errors in sensors.items()
        for statistic in ("mean", "max", "std")
    }
    timing = {name: getattr(flight, name) for name in TIMING}
    names = {"scenario": flight.scenario, "vehicle": flight.vehicle, "renderer": flight.renderer}
    return names | figures | flat | timing


def _schema() -> pa.Schema:
    """Columns of a part, so that parts agree where a column is all null."""
    kinds = {"success": pa.bool_(), "landed": pa.bool_(), "reason": pa.string()}
    columns = [("run", pa.int64()), ("seed", pa.string()), ("error", pa.string())]
    columns += [(name, pa.string()) for name in ("scenario", "vehicle", "renderer")]
    names = [name for name in Summary.__dataclass_fields__ if name != "sensor_height_error_m"]
    columns += [(name, kinds.get(name, pa.float64())) for name in names]
    for sensor in ("baro", "gps", "vision", "sonar"):
        columns += [(f"{sensor}_height_{statistic}_error_m", pa.float64()) for statistic in ("mean", "max", "std")]
    columns += [(name, pa.float64()) for name in TIMING]
    return pa.schema(columns)


SCHEMA = _schema()


def _gather(parts: Path, folder: Path, runs: int) -> pa.Table:
    """runs.parquet and timing.parquet from the parts."""
    tables = [pq.read_table(path) for path in sorted(parts.glob("runs-*.parquet"))]
    whole = pa.concat_tables(tables).sort_by("run") if tables else SCHEMA.empty_table()
    whole = whole.filter(pc.less(whole["run"], runs))
    flights = whole.drop_columns(list(TIMING))
    for name, table in (("runs", flights), ("timing", whole.select(["run", *TIMING]))):
        draft = folder / f"{name}.parquet.part"
        pq.write_table(table, draft, compression="zstd")
        os.replace(draft, folder / f"{name}.parquet")
    return flights


@dataclass(frozen=True)
class Share:
    """Part of the runs, with its 95 % interval (Wilson)."""

    count: int
    of: int
    share: float
    low: float
    high: float

    @classmethod
    def of_runs(cls, hits: int, runs: int) -> "Share":
        """The share of `hits` among `runs` > 0."""
        interval = binomtest(hits, runs).proportion_ci(0.95, method="wilson")
        return cls(hits, runs, hits / runs, float(interval.low), float(interval.high))


@dataclass(frozen=True)
class CampaignSummary:
    """What a campaign came to."""

    runs: int
    failed: int  # runs that ended in an error
    success: Share
    landed: Share
    quantiles: dict[str, dict[str, float]]  # by column: median, 95th percentile, maximum


def summarise(table: pa.Table) -> CampaignSummary:
    """Shares with their intervals, and how the figures are spread."""
    frame = table.to_pydict()
    runs = table.num_rows
    quantiles = {}
    for name in (
        "touchdown_offset_m", "touchdown_sink_m_s", "touchdown_drift_m_s", "late_speed_max_m_s", "max_roll_deg",
        "max_pitch_deg", "fused_height_mean_error_m", "fused_height_max_error_m",
    ):  # fmt: skip
        values = sorted(value for value in frame[name] if value is not None)
        if values:
            median, high = np.percentile(values, [50, 95])
            quantiles[name] = {"median": float(median), "p95": float(high), "max": float(values[-1])}
    return CampaignSummary(
        runs=runs,
        failed=sum(error is not None for error in frame["error"]),
        success=Share.of_runs(sum(map(bool, frame["success"])), runs),
        landed=Share.of_runs(sum(map(bool, frame["landed"])), runs),
        quantiles=quantiles,
    )
