"""An extended vehicle file has what was found, keeps what it had, and flies."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.causes import CATALOGUE
from identification.extension import Delta, digest, extended, write
from identification.model import NEUTRAL
from sim import sensors, vehicle
from sim.vehicle import Vehicle

NUMBERS = {  # key: SI value, unit, std
    "terms.ground_effect.gain": (1.7, "1", 0.05),
    "terms.servo.delay": (0.0345, "s", 0.001),  # in the file in ms
    "terms.drag.area": (0.06, "m^2", 0.004),  # not in force in the file
    "inertia.1": (0.2, "kg m^2", 0.002),
    "mass": (5.3, "kg", 0.01),
    "sensors.gps.bias_e": (3.25, "m", 0.2),  # not in the file
    "sensors.imu.misalignment_x": (0.021, "rad", 0.001),
    "cameras.down.roll": (0.03, "rad", 0.001),
    "cameras.down.focal_scale": (1.02, "1", 0.002),
    "cameras.down.stamp_delay": (0.015, "s", 0.001),
}


def delta(keys: list[str], values: dict[str, float] | None = None) -> Delta:
    spread = np.array([NUMBERS[key][2] for key in keys])
    correlation = np.eye(len(keys)) + 0.3 * (1.0 - np.eye(len(keys)))
    return Delta(
        values={key: (values or {}).get(key, NUMBERS[key][0]) for key in keys},
        causes=dict.fromkeys(keys, "something"), units={key: NUMBERS[key][1] for key in keys},
        covariance=correlation * np.outer(spread, spread), visited={"height_m": (0.2, 10.0)},
    )  # fmt: skip


def value(found: Vehicle, key: str) -> float:
    section, *rest = key.split(".")
    match section:
        case "terms":
            return found.parameters[rest[0]][rest[1]]
        case "sensors":
            return found.sensors[rest[0]].numbers[rest[1]]
        case "inertia":
            return float(found.inertia[int(rest[0])])
        case "mass":
            return float(found.geometry["mass"])
    camera = found.cameras["down"]
    roll = float(np.arctan2(camera.mount.axes[1, 2], -camera.mount.axes[2, 2]))
    return {"roll": roll, "focal_scale": camera.focal_scale, "stamp_delay": camera.stamp_delay}[rest[1]]


def test_every_number_comes_back_in_si_and_the_rest_is_as_it_was(tmp_path: Path) -> None:
    before = vehicle.load("raptor90")
    after = write(before, delta(list(NUMBERS)), {"one": "ab"}, tmp_path / "extended.toml")
    for key, (wanted, _, _) in NUMBERS.items():
        assert value(after, key) == pytest.approx(wanted, rel=1e-8), key
    for term, numbers in before.parameters.items():
        for name, number in numbers.items():
            if f"terms.{term}.{name}" not in NUMBERS:
                assert after.parameters[term][name] == number
    text = (tmp_path / "extended.toml").read_text(encoding="utf-8")
    assert 'delay = {value = 34.5, unit = "ms", tolerance = 1.0' in text
    assert "# --- sensors as fitted" in text
    extension = tomllib.loads(text)["extension"]
    assert extension["of"] == "raptor90"
    assert extension["visited"] == {"height_m": [0.2, 10.0]}
    keys, matrix = extension["covariance"]["keys"], np.array(extension["covariance"]["matrix"])
    assert keys == sorted(NUMBERS)
    assert np.sqrt(matrix[keys.index("mass"), keys.index("mass")]) == pytest.approx(0.01)
    assert matrix[0, 1] == pytest.approx(0.3 * np.sqrt(matrix[0, 0] * matrix[1, 1]))


@settings(max_examples=2, deadline=None)
@given(st.permutations(list(NUMBERS)), st.integers(1, len(NUMBERS) - 1))
def test_the_order_of_the_changes_does_not_matter(order: list[str], first: int) -> None:
    before = vehicle.load("raptor90")
    once = extended(before, delta(order), {})
    assert once == extended(before, delta(sorted(order)), {})
    half = vehicle.from_document(tomllib.loads(extended(before, delta(order[:first]), {})), "half")
    both = vehicle.from_document(tomllib.loads(extended(half, delta(order[first:]), {})), "both")
    whole = vehicle.from_document(tomllib.loads(once), "whole")
    for key in NUMBERS:
        assert value(both, key) == pytest.approx(value(whole, key), rel=1e-8)
    assert [t.name for t in both.terms] == [t.name for t in whole.terms]


def test_every_cause_of_a_helicopter_can_be_written(tmp_path: Path) -> None:
    """Planted once: a key that no sensor has ends in a UserError when the file is loaded."""
    kept = ("mass", "inertia", "terms", "sensors", "cameras", "environment")
    found = {
        p.key: (p, cause.name)
        for cause in CATALOGUE.values()
        for p in cause.parameters
        if "helicopter" in cause.kinds and not cause.counted and p.key.split(".")[0] in kept
    }
    values = {key: p.nominal + 0.01 * p.spread for key, (p, _) in found.items()}
    values |= {key: 5.0 for key in values if key == "mass"}
    change = Delta(
        values, {key: cause for key, (_, cause) in found.items()}, {key: p.unit for key, (p, _) in found.items()},
        np.diag([(0.1 * p.spread) ** 2 for p, _ in found.values()]), {},
    )  # fmt: skip
    after = write(vehicle.load("raptor90"), change, {}, tmp_path / "extended.toml")
    assert value(after, "sensors.gps.bias_e") == pytest.approx(values["sensors.gps.bias_e"])


def test_a_neutral_term_does_nothing_until_it_is_turned() -> None:
    for name, numbers in NEUTRAL.items():
        assert set(numbers) <= {p.name for p in vehicle.terms.CATALOGUE[name].parameters}


def test_what_lies_beyond_the_range_is_written_at_its_end(tmp_path: Path) -> None:
    low = next(p.low for p in sensors.CATALOGUE["gps"].PARAMETERS if p.name == "delay")
    found = Delta({"sensors.gps.delay": low - 0.01}, {"sensors.gps.delay": "gps_latency"}, {"sensors.gps.delay": "s"},
                  np.array([[1e-6]]), {})  # fmt: skip
    after = write(vehicle.load("raptor90"), found, {}, tmp_path / "extended.toml")
    assert after.sensors["gps"].numbers["delay"] == low


def test_a_digest_is_of_what_was_measured_alone(tmp_path: Path) -> None:
    (tmp_path / "measured").mkdir()
    (tmp_path / "truth").mkdir()
    (tmp_path / "measured" / "imu.parquet").write_bytes(b"1")
    before = digest(tmp_path)
    (tmp_path / "truth" / "state.parquet").write_bytes(b"2")
    assert digest(tmp_path) == before
    (tmp_path / "measured" / "imu.parquet").write_bytes(b"3")
    assert digest(tmp_path) != before
