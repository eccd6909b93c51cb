"""Logs of others, where they lie beside the project."""

import os
from pathlib import Path

import numpy as np
import pytest

import assets
from flightlog.readers import read_log

DATA = Path(os.environ.get("HELIDECK_DATA", Path(__file__).parents[3] / "shared" / "data"))
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="no measured data: set HELIDECK_DATA to its folder")


def mapping(name):
    return assets.path("mappings", f"{name}.toml")


def test_the_laboratory_helicopter():
    log = read_log(DATA / "lab_helicopter" / "Lab-Helicopter_Experimental-data.csv", mapping("lab_helicopter"))
    assert log.notes == () and log.duration == pytest.approx(130.99)
    joints, controls = log.tables["joints"], log.tables["controls"]
    assert len(joints) == len(controls) == 13_100
    assert joints["pitch"][0] == -0.66698 and joints["yaw"][0] == 0.81165
    assert controls["pitch_motor"][0] == 1.2098 and controls.unit("yaw_motor") == "V"


CRAZYFLIES = sorted((DATA / "crazypad").rglob("*.csv.gz"))


@pytest.mark.parametrize("path", CRAZYFLIES, ids=lambda path: f"{path.parent.name}-{path.name[:8]}")
def test_crazyflies(path):
    log = read_log(path, mapping("crazypad"))
    estimate, controls, battery = (log.tables[name] for name in ("estimate", "controls", "battery"))
    assert 24.0 < log.duration < 27.0
    motors = controls.stack("m1", "m2", "m3", "m4")
    assert motors.min() == 0.0 and 0.5 < motors.max() <= 1.0
    assert 3.0 < battery["voltage"].min() < battery["voltage"].max() < 4.3
    # velocity and acceleration are of the same axes and units as the position
    t = estimate["t"]
    for axis, low in (("e", 0.9), ("u", 0.9)):
        moved = np.cumsum(estimate[f"v{axis}"][1:] * np.diff(t))
        assert np.corrcoef(moved, estimate[axis][1:])[0, 1] > low
    climbs = (estimate["u"] > 0.1) & (np.gradient(estimate["vu"], t) > 0.5)
    assert np.median(estimate["au"][climbs]) > 0.2


def test_a_helicopter_s_text_log():
    log = read_log(DATA / "ardupilot" / "tradheli_brownout.log")
    assert {name: len(table) for name, table in log.tables.items()} == {
        "baro": 1234, "gps": 620, "sonar": 1234, "controls": 1234, "battery": 123, "estimate": 1207
    }  # fmt: skip
    assert log.timed == {"gps"}
    assert "collective" in log.tables["controls"]
    # two flights with 42 s between them: nothing is placed in between
    t = log.tables["baro"]["t"]
    assert np.sort(np.diff(t))[-1] > 40.0 and np.sort(np.diff(t))[-3] < 1.0
    # rows placed by order keep step with the fixes: what climbs does so in both at once
    baro, gps = log.tables["baro"], log.tables["gps"]
    climb = baro["t"] > baro["t"][-1] - 25.0
    apart = baro["altitude"][climb] - np.interp(baro["t"][climb], gps["t"], gps["u"])
    assert np.abs(apart - np.median(apart)).max() < 4.0


def test_an_octocopter_s_text_log():
    log = read_log(DATA / "ardupilot" / "robert_lefebvre_octo_PM.log")
    assert "sonar" not in log.tables and any("no sonar" in note for note in log.notes)
    assert np.abs(np.diff(log.tables["baro"]["altitude"])).max() == pytest.approx(161.61)


def test_a_quadrotor_s_binary_log_as_pymavlink_reads_it():
    path = DATA / "arducopter" / "00000081.BIN"
    log = read_log(path)
    assert {name: len(table) for name, table in log.tables.items() if name.startswith(("imu", "baro", "mag"))} == {
        "imu": 1255, "imu_2": 1255, "imu_3": 1255, "baro": 502, "baro_2": 502, "mag": 502, "mag_2": 502
    }  # fmt: skip
    assert log.timed == log.tables.keys()
    DFReader = pytest.importorskip("pymavlink.DFReader")
    reader = DFReader.DFReader_binary(str(path), zero_time_base=False)
    theirs = []
    while (message := reader.recv_match(type=["IMU"])) is not None:
        if message.I == 1:
            theirs.append((message.TimeUS * 1e-6, message.AccX, -message.AccY, -message.AccZ))
    np.testing.assert_allclose(log.tables["imu_2"].stack("t", "fx", "fy", "fz"), theirs)
    quiet = log.tables["imu"]["t"] < 48.0
    assert np.median(log.tables["imu"]["fz"][quiet]) == pytest.approx(9.8, abs=0.1)
