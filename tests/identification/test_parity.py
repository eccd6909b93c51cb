"""Sensors against each other: faults of foreign making are named, everyday logs are left in peace."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from flightlog.errors import UserError
from identification.logs import read
from identification.parity import judge
from identification.verdict import Verdict
from tests.identification.everyday_log import Made, everyday

DATA = Path(os.environ.get("HELIDECK_DATA", Path(__file__).parents[3] / "shared" / "data"))


def real(path: str) -> Verdict:
    """The verdict on one of the real logs."""
    if not (DATA / path).is_file():
        pytest.skip(f"no measured data: {DATA / path} is missing (HELIDECK_DATA names the folder)")
    return judge(read([DATA / path]).tables)


def names(verdict: Verdict) -> list[str]:
    return [cause.name for cause in verdict.causes]


def said(made: Made) -> Verdict:
    return judge({"flight": made.tables()})


def walk(topic: str, column: str, by: float) -> Callable[[Made], None]:
    def do(made: Made) -> None:
        columns = made.columns[topic]
        columns[column] = columns[column] + by * np.clip((columns["t"] - 30.0) / 40.0, 0.0, 1.0)

    return do


def jump(made: Made) -> None:
    baro = made.columns["baro"]["altitude"]
    for row, size in ((300, 60.0), (520, 161.0), (524, 140.0), (700, -25.0)):
        baro[row : row + 3] += size


def echo_anywhere(made: Made) -> None:
    sonar, rng = made.columns["sonar"], np.random.default_rng(1)
    far = np.interp(sonar["t"], made.t, made.height) > 7.0
    sonar["range"] = np.where(far, rng.uniform(0.5, 5.0, len(far)), sonar["range"])


def echo_of_the_skid(made: Made) -> None:
    sonar, rng = made.columns["sonar"], np.random.default_rng(2)
    far = np.interp(sonar["t"], made.t, made.height) > 7.0
    sonar["range"] = np.where(far, 0.4 + 0.01 * rng.standard_normal(len(far)), sonar["range"])


def clock(made: Made) -> None:
    made.columns["gps"]["t"] = made.columns["gps"]["t"] + 7.0


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("ardupilot/tradheli_brownout.log", "sonar_false_echo"),
        ("ardupilot/robert_lefebvre_octo_PM.log", "baro_glitch"),
        ("arducopter/00000081.BIN", "gps_drift"),
    ],
)
def test_real_logs_are_named(path: str, name: str) -> None:
    verdict = real(path)
    assert names(verdict) == [name]
    assert verdict.baseline.certified


def test_gps_height_that_walks_shows_in_its_channel() -> None:
    verdict = real("arducopter/00000081.BIN")
    rate = verdict.causes[0].parameters["u"]
    assert -8.5 < rate.value * 50.0 < -5.5  # it ends 7 m below where it began
    gps = next(c for c in verdict.channels if c.channel == "gps.u")
    assert gps.rmse_after < 0.2 * gps.rmse_before


@pytest.mark.parametrize("seed", range(24))
def test_nothing_is_named_where_nothing_is_wrong(seed: int) -> None:
    made = everyday(1000 + seed, doppler=seed % 2 == 0, barometers=1 + (seed % 3 == 0), sonar=seed % 4 != 0)
    assert names(said(made)) == []


@pytest.mark.parametrize("seed", range(500, 503))
@pytest.mark.parametrize(
    ("fault", "name"),
    [
        (jump, "baro_glitch"),
        (echo_anywhere, "sonar_false_echo"),
        (echo_of_the_skid, "sonar_false_echo"),
        (clock, "clock_offset"),
        (walk("gps", "u", -30.0), "gps_drift"),
        (walk("baro", "altitude", 30.0), "baro_drift"),
    ],
)
def test_faults_are_named_and_nothing_else(fault: Callable[[Made], None], name: str, seed: int) -> None:
    made = everyday(seed, duration=100.0)
    fault(made)
    assert names(said(made)) == [name]


@pytest.mark.parametrize("seed", range(500, 503))
def test_of_two_heights_neither_is_blamed(seed: int) -> None:
    made = everyday(seed, duration=100.0, doppler=False)
    del made.columns["controls"]  # so nothing tells when it stands on the ground
    walk("baro", "altitude", -30.0)(made)
    (cause,) = said(made).causes
    assert {cause.name, *cause.confusable_with} == {"baro_drift", "gps_drift"}
    assert cause.split_by


def test_one_height_alone_is_not_judged() -> None:
    made = everyday(3, duration=70.0, sonar=False)
    del made.columns["gps"]
    verdict = said(made)
    assert not verdict.baseline.certified
    assert verdict.causes == []


def test_a_dead_channel_is_told_and_blamed_for_nothing() -> None:
    made = everyday(4, duration=70.0)
    made.columns["baro"]["altitude"][:] = 3.0
    verdict = said(made)
    assert names(verdict) == []
    assert any("baro.altitude: stands still" in note for note in verdict.notes)


def test_heights_of_different_flights_are_not_judged() -> None:
    made, other = everyday(5, duration=100.0), everyday(77, duration=100.0)
    made.columns["baro"] = other.columns["baro"]
    verdict = said(made)
    assert "gps_drift" not in names(verdict) and "baro_drift" not in names(verdict)


@pytest.mark.parametrize(("factor", "word"), [(-1.0, "NED"), (1.0 / 0.3048, "ft")])
def test_a_wrong_sign_or_unit_is_told(factor: float, word: str) -> None:
    made = everyday(501, duration=100.0)
    made.columns["baro"]["altitude"] *= factor
    with pytest.raises(UserError, match=word):
        said(made)
