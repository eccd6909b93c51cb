"""`helideck diagnose` and its list: what cannot be read ends with one clear line and exit code 2."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from helideck.cli import main
from identification.causes import CATALOGUE, TOLD


def flight(folder: Path, **topics: dict[str, np.ndarray]) -> Path:
    (folder / "measured").mkdir(parents=True)
    (folder / "flight.json").write_text('{"scenario_name": "made", "seed": [0]}', encoding="utf-8")
    for topic, columns in topics.items():
        pq.write_table(pa.table(columns), folder / "measured" / f"{topic}.parquet")
    return folder


def hover(seconds: float = 20.0, gravity: float = 9.81) -> dict[str, dict[str, np.ndarray]]:
    t = np.arange(0.0, seconds, 0.01)
    noise = np.random.default_rng(0).standard_normal((6, len(t))) * 0.01
    imu = dict(zip(("fx", "fy", "fz", "wx", "wy", "wz"), noise, strict=True))
    imu["fz"] = imu["fz"] + gravity
    return {"imu": {"t": t, **imu}, "baro": {"t": t, "altitude": 2.0 + noise[0] * 10.0}}


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(["diagnose", *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    lines = said.err.strip().splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def test_a_log_that_is_none_is_named(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    assert "no such log" in refused(capsys, str(tmp_path / "nothing"), "--vehicle", "raptor90", "-o", out)
    (tmp_path / "empty.csv").write_bytes(b"")
    assert "empty" in refused(capsys, str(tmp_path / "empty.csv"), "-o", out)


def test_a_log_given_twice_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = str(flight(tmp_path / "one", **hover()))
    out = str(tmp_path / "out")
    assert "given twice" in refused(capsys, log, log, "--vehicle", "raptor90", "-o", out)
    assert "given twice" in refused(capsys, log, "--heldout", log, "--vehicle", "raptor90", "-o", out)


def test_a_vehicle_is_needed_for_normal_flights(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    one, two = (str(flight(tmp_path / name, **hover())) for name in ("one", "two"))
    assert "--vehicle" in refused(capsys, one, "--normal", two, "-o", str(tmp_path / "out"))


def test_what_the_vehicle_needs_and_the_log_lacks_is_named(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = str(flight(tmp_path / "one", **hover()))
    said = refused(capsys, log, "--vehicle", "raptor90", "-o", str(tmp_path / "out"))
    assert "controls" in said
    assert "one" in said


def test_wrong_units_are_named_with_the_likely_right_one(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = str(flight(tmp_path / "cm", **hover(gravity=981.0)))
    said = refused(capsys, log, "--vehicle", "raptor90", "-o", str(tmp_path / "out"))
    assert "cm/s^2" in said


def test_a_moment_is_too_short(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = str(flight(tmp_path / "short", **hover(seconds=1.0)))
    assert "at least" in refused(capsys, log, "--vehicle", "raptor90", "-o", str(tmp_path / "out"))


def test_errors_are_json_as_well(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["diagnose", str(tmp_path / "nothing"), "--json"]) == 2
    assert "no such log" in json.loads(capsys.readouterr().out)["error"]


def test_causes_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "causes", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in rows] == list(TOLD)
    assert {cause.title for cause in CATALOGUE.values()} <= TOLD.keys()
    assert all(row["description"].startswith(("plant", "sensor", "timing")) for row in rows)


def test_without_a_vehicle_sensors_are_judged_and_a_report_written(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    log = str(flight(tmp_path / "one", **hover()))
    out = tmp_path / "out"
    code = main(["diagnose", log, "-o", str(out), "--json"])
    document = json.loads(capsys.readouterr().out)
    assert document["vehicle"] is None
    assert document["causes"] == []
    assert code == (0 if document["baseline"]["certified"] else 1)
    assert json.loads((out / "diagnosis.json").read_text(encoding="utf-8")) == document
    assert "<h1>Diagnosis</h1>" in (out / "report.html").read_text(encoding="utf-8")
