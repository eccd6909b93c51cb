"""Logs of autopilots that break off, or are broken, anywhere: what is left is judged, or refused in one line."""

import json

import numpy as np
import pytest

from flightlog.errors import UserError
from helideck.cli import main
from identification.intake import sound
from identification.logs import read
from identification.parity import judge
from tests.flightlog.log_writers import dataflash, ulog
from tests.identification.everyday_log import everyday


def stamps(t):
    return "uint64_t", np.round(1e6 * t).astype(np.uint64)


def as_ulog() -> bytes:
    made = everyday(21, duration=90.0).columns
    baro, gps, sonar = made["baro"], made["gps"], made["sonar"]
    single = "float"
    return ulog({
        ("vehicle_air_data", 0): {
            "timestamp": stamps(baro["t"]), "baro_alt_meter": (single, baro["altitude"]),
            "baro_pressure_pa": (single, 101325.0 - 12.0 * baro["altitude"]),
        },
        ("vehicle_gps_position", 0): {
            "timestamp": stamps(gps["t"]),
            "lat": ("int32_t", np.round(47e7 + gps["n"] * 89.8)), "lon": ("int32_t", np.round(8e7 + gps["e"] * 131.7)),
            "alt": ("int32_t", np.round(1e3 * gps["u"])), "fix_type": ("uint8_t", np.full(len(gps["t"]), 3)),
            "vel_n_m_s": (single, gps["vn"]), "vel_e_m_s": (single, gps["ve"]), "vel_d_m_s": (single, -gps["vu"]),
        },
        ("distance_sensor", 0): {"timestamp": stamps(sonar["t"]), "current_distance": (single, sonar["range"]),
                                 "orientation": ("uint8_t", np.full(len(sonar["t"]), 25))},
    })  # fmt: skip


def as_dataflash() -> bytes:
    made = everyday(21, duration=90.0).columns
    baro, gps = made["baro"], made["gps"]
    height = np.interp(baro["t"], gps["t"], gps["u"])
    rows = [("BARO", (int(1e6 * t), float(a), 101325.0 - 12.0 * float(a)))
            for t, a in zip(baro["t"], baro["altitude"], strict=True)]  # fmt: skip
    rows += [
        ("GPS", (int(1e6 * t) + 1, 3, int(47e7 + n * 89.8), int(8e7 + e * 131.7), int(100.0 * u)))
        for t, n, e, u in zip(gps["t"], gps["n"], gps["e"], gps["u"], strict=True)
    ]
    rows.sort(key=lambda row: row[1][0])
    assert np.isfinite(height).all()
    return dataflash({
        "BARO": ("Qff", "TimeUS,Alt,Press"), "GPS": ("QBLLe", "TimeUS,Status,Lat,Lng,Alt"),
    }, rows)  # fmt: skip


MADE = {"ulg": as_ulog, "bin": as_dataflash}
# within the header, the definitions, a message, between messages; and most of the log
CUTS = (0, 1, 5, 16, 40, 100, 300, 1000, 5_001, 0.1, 0.37, 0.5, 0.9, 0.999)


@pytest.fixture(scope="module", params=MADE)
def whole(request) -> tuple[str, bytes]:
    return request.param, MADE[request.param]()


def test_whole_it_says_that_nothing_is_wrong(whole, tmp_path, capsys) -> None:
    kind, data = whole
    (tmp_path / f"log.{kind}").write_bytes(data)
    assert main(["diagnose", str(tmp_path / f"log.{kind}"), "-o", str(tmp_path / "out"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["causes"] == []
    assert found["baseline"]["certified"]


@pytest.mark.parametrize("cut", CUTS)
def test_cut_anywhere_no_sensor_is_blamed(whole, tmp_path, cut) -> None:
    kind, data = whole
    path = tmp_path / f"log.{kind}"
    path.write_bytes(data[: cut if isinstance(cut, int) else int(cut * len(data))])
    try:
        flights = sound(read([path]), None)
    except UserError as error:
        assert str(path) in str(error) and "\n" not in str(error)
        return
    verdict = judge(flights.tables)
    assert verdict.causes == []
    assert flights.notes


@pytest.mark.parametrize("seed", range(12))
def test_with_bytes_overwritten_no_sensor_is_blamed_for_a_drift(whole, tmp_path, seed) -> None:
    kind, data = whole
    rng, broken, path = np.random.default_rng(seed), bytearray(data), tmp_path / f"log.{kind}"
    for at in rng.integers(0, len(data) - 30, 3).tolist():
        broken[at : at + 20] = rng.bytes(20)
    path.write_bytes(broken)
    try:
        verdict = judge(sound(read([path]), None).tables)
    except UserError as error:
        assert "\n" not in str(error)
        return
    assert {cause.name for cause in verdict.causes} <= {"baro_glitch"}  # a value that is read wrong jumps
