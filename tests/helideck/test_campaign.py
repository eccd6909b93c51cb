"""Campaigns: the same table for any number of workers, resumable after a kill, bad runs kept, shares with intervals."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from rich.console import Console

import helideck.show
from flightlog.errors import UserError
from helideck.cli import main
from scenarios import campaign as campaigns
from scenarios.campaign import Campaign, Share, run_campaign, summarise
from scenarios.flight import fly
from scenarios.load import load
from sim.divergence import SimulationDiverged

ROOT = Path(__file__).parents[2]
RUNS = 7


def plan(seed=5, **changes):
    settings = {"duration_s": 0.8, **changes}
    return Campaign("landing", load("landing", settings), seed, "raptor90", {}, "raptor90")


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Seven runs by one worker; the folder, its table and what was told of the progress."""
    folder = tmp_path_factory.mktemp("campaigns") / "one"
    told = []
    table = run_campaign(plan(), RUNS, folder, workers=1, progress=lambda done, runs: told.append((done, runs)))
    return folder, table, told


def test_a_table_has_a_row_a_run_with_all_that_land_tells(flown):
    folder, table, told = flown
    assert pq.read_table(folder / "runs.parquet").equals(table)
    assert table["run"].to_pylist() == list(range(RUNS))
    assert table["seed"].to_pylist() == [f"5:{run}" for run in range(RUNS)]
    assert table["error"].null_count == RUNS
    promised = {"success", "landed", "reason", "touchdown_offset_m", "fused_height_mean_error_m", "duration_s",
                "baro_height_mean_error_m", "vision_height_max_error_m", "scenario", "vehicle"}  # fmt: skip
    assert promised <= set(table.column_names)
    assert len(set(table["max_roll_deg"].to_pylist())) == RUNS  # each with a seed of its own
    timing = pq.read_table(folder / "timing.parquet")
    assert timing["run"].to_pylist() == list(range(RUNS)) and min(timing["real_time_factor"].to_pylist()) > 0.0
    assert told[0] == (0, RUNS) and told[-1] == (RUNS, RUNS)


def test_a_row_is_the_flight_of_its_seed(flown):
    _, table, _ = flown
    row = table.to_pylist()[3]
    summary = fly(plan().scenario, seed=(5, 3), cameras=False).summary
    for name in ("success", "reason", "max_roll_deg", "fused_height_mean_error_m", "duration_s"):
        assert row[name] == getattr(summary, name), name


def test_two_workers_write_the_same_file(flown, tmp_path):
    folder, _, _ = flown
    run_campaign(plan(), RUNS, tmp_path / "two", workers=2)
    assert (tmp_path / "two" / "runs.parquet").read_bytes() == (folder / "runs.parquet").read_bytes()


def test_more_runs_go_on_where_fewer_stopped_and_fewer_show_the_first(flown, tmp_path):
    folder, _, _ = flown
    run_campaign(plan(), 3, tmp_path / "c", workers=1)
    parts = {path: path.stat().st_mtime_ns for path in (tmp_path / "c" / "parts").iterdir()}
    told = []
    run_campaign(plan(), RUNS, tmp_path / "c", workers=1, progress=lambda done, runs: told.append((done, runs)))
    assert told[0] == (3, RUNS)
    assert all(path.stat().st_mtime_ns == written for path, written in parts.items())
    assert (tmp_path / "c" / "runs.parquet").read_bytes() == (folder / "runs.parquet").read_bytes()
    again = run_campaign(plan(), RUNS, tmp_path / "c", workers=1, progress=lambda *now: told.append(now))
    assert told[-1] == (RUNS, RUNS) and again.num_rows == RUNS
    assert run_campaign(plan(), 2, tmp_path / "c", workers=1).num_rows == 2


@pytest.mark.parametrize(
    "other",
    [
        plan(seed=6), plan(**{"weather.wind_m_s": 2.0}), Campaign("landing", plan().scenario, 5, "raptor90",
        {"terms.ground_effect.gain": 0.9}, "raptor90"), Campaign("landing", plan().scenario, 5, "raptor90", {},
        "raptor90", cameras=True),
    ],
    ids=["seed", "weather", "vehicle", "cameras"],
)  # fmt: skip
def test_other_settings_in_the_same_folder_are_refused(flown, other):
    folder, _, _ = flown
    before = (folder / "campaign.json").read_bytes()
    with pytest.raises(UserError, match="holds another campaign"):
        run_campaign(other, RUNS, folder, workers=1)
    assert (folder / "campaign.json").read_bytes() == before


def test_a_bad_run_is_a_row_with_its_error(monkeypatch, tmp_path):
    def sometimes(scenario, *, seed, **keywords):
        if seed[1] == 1:
            raise SimulationDiverged("the physics left the numbers at t = 0.500 s")
        return fly(scenario, seed=seed, **keywords)

    monkeypatch.setattr(campaigns, "fly", sometimes)
    table = run_campaign(plan(), 3, tmp_path / "bad", workers=1)
    rows = table.to_pylist()
    assert [row["error"] for row in rows] == [
        None, "SimulationDiverged: the physics left the numbers at t = 0.500 s", None,
    ]  # fmt: skip
    assert rows[1]["success"] is False and rows[1]["max_roll_deg"] is None
    summary = summarise(table)
    assert (summary.runs, summary.failed) == (3, 1) and summary.success.of == 3


def test_after_a_kill_it_goes_on_to_the_same_table(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["campaign", "landing", "--runs", "12", "--workers", "1", "--seed", "5", "--set", "duration_s=0.8"]
    code = "import sys; from helideck.cli import main; sys.exit(main())"
    process = subprocess.Popen([sys.executable, "-c", code, *words, "-o", "killed"], cwd=tmp_path,
                               env=os.environ | {"PYTHONPATH": str(ROOT)})  # fmt: skip
    parts = tmp_path / "killed" / "parts"
    until = time.monotonic() + 120.0
    while not (parts.is_dir() and list(parts.glob("runs-*.parquet"))):
        assert process.poll() is None and time.monotonic() < until
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    kept = {path: path.stat().st_mtime_ns for path in parts.glob("runs-*.parquet")}
    assert not (tmp_path / "killed" / "runs.parquet").exists()
    assert main([*words, "-o", "killed", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["runs"] == 12 and document["failed"] == 0
    assert all(path.stat().st_mtime_ns == written for path, written in kept.items())
    table = pq.read_table(tmp_path / "killed" / "runs.parquet")
    assert table["run"].to_pylist() == list(range(12))
    assert main([*words, "-o", "killed", "--set", "weather.wind_m_s=3"]) == 2
    assert "holds another campaign" in capsys.readouterr().err


def test_it_prints_shares_with_their_intervals_and_where_the_table_is(flown, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["campaign", "landing", "--runs", "1", "--workers", "1", "--set", "duration_s=0.6"]) == 0
    out = capsys.readouterr()
    assert "1 runs, 0 of them ended in an error" in out.out
    assert "0/1" in out.out and "95 % interval" in out.out and "campaigns/landing-0/runs.parquet" in out.out
    assert out.err == ""


@pytest.mark.parametrize(("hits", "runs"), [(19, 20), (0, 10), (10, 10), (1, 1), (137, 200)])
def test_intervals_are_wilsons(hits, runs):
    """Against the closed form."""
    share = Share.of_runs(hits, runs)
    z, p = 1.959963984540054, hits / runs
    centre = (p + z * z / (2 * runs)) / (1 + z * z / runs)
    half = z * math.sqrt(p * (1 - p) / runs + z * z / (4 * runs * runs)) / (1 + z * z / runs)
    assert (share.low, share.high) == pytest.approx((max(0.0, centre - half), min(1.0, centre + half)), abs=1e-12)
    assert share.share == p


def test_figures_are_spread_as_numpy_says(flown):
    _, table, _ = flown
    values = table["max_roll_deg"].to_pylist()
    spread = summarise(table).quantiles["max_roll_deg"]
    assert spread["median"] == pytest.approx(np.median(values)) and spread["max"] == max(values)
    assert "touchdown_offset_m" not in summarise(table).quantiles  # nothing touched


def test_the_time_left_is_shown(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")  # rich draws no bars on a dumb terminal
    console = Console(stderr=True, force_terminal=True, width=100, record=True)
    monkeypatch.setattr(helideck.show, "Console", lambda **_: console)
    with helideck.show.campaign_progress("landing") as progress:
        progress(0, 10)
        for done in (2, 4, 6):
            time.sleep(0.06)
            progress(done, 10)
    text = console.export_text()
    assert "6/10" in text and "left" in text and "0:00:0" in text
