"""Multirotors: what the balances name, on simulated flights and on measured ones."""

import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from flightlog.errors import UserError
from flightlog.tables import Table
from flightlog.topics import topic_of
from identification.diagnosis import diagnose
from identification.logs import read
from identification.normal import refit_to
from sim.kinds import load
from sim.multirotor import load_multirotor, multirotor_from
from sim.multirotor.model import Inputs, answer
from sim.multirotor.simulate import fly

DATA = Path(os.environ.get("HELIDECK_DATA", Path(__file__).parents[3] / "shared" / "data")) / "crazypad"
measured = pytest.mark.skipif(not DATA.is_dir(), reason="no measured logs: set HELIDECK_DATA to their folder")


@pytest.fixture(scope="module")
def craft():
    return load_multirotor("crazyflie")


def tables(columns):
    return {topic: Table(topic, pa.table(dict(found)), topic_of("measured", topic)) for topic, found in columns.items()}


@pytest.fixture(scope="module")
def nominal(craft, tmp_path_factory):
    good = {f"good{i}": tables(fly(craft, np.random.default_rng(i), 20.0)) for i in range(2)}
    return refit_to(craft, good, tmp_path_factory.mktemp("nominal") / "nominal.toml")


def verdict(nominal, craft, seed, **truth):
    return diagnose({"flight": tables(fly(craft, np.random.default_rng(seed), 20.0, truth))}, nominal)


def test_hover_carries_the_weight(craft):
    one = answer(craft, craft.values(), Inputs(0.01, np.full((3, 4), 0.62), np.full(3, 3.7), np.zeros((3, 3))))
    lift = 4 * np.interp(0.62, *craft.tables[0].T)
    assert one[:, 2] == pytest.approx(lift / craft.mass)
    assert one[:, 3:] == pytest.approx(0.0, abs=1e-9)


def test_a_stronger_rotor_turns_the_way_its_place_and_spin_say(craft):
    one = answer(craft, craft.values({"rotors.2.thrust_scale": 1.1}), Inputs(
        0.01, np.full((3, 4), 0.62), np.full(3, 3.7), np.zeros((3, 3))))[0]  # fmt: skip
    # rotor 3, back left and counter-clockwise: right side down, nose down, nose to the right
    assert one[3] > 0.0
    assert one[4] > 0.0
    assert one[5] < 0.0


def test_a_normal_flight_is_not_accused(nominal, craft):
    found = verdict(nominal, craft, 10)
    assert found.baseline.certified
    assert found.causes == []


def test_a_damaged_rotor_is_named_by_its_number(nominal, craft):
    found = verdict(nominal, craft, 11, **{"rotors.2.thrust_scale": 0.8})
    (cause,) = found.causes
    assert cause.name == "rotor_damage"
    assert cause.parameters["rotor"].value == 3
    assert cause.parameters["scale"].value == pytest.approx(0.8, abs=0.03)


def test_a_weight_is_found_where_it_hangs(nominal, craft):
    added, x, y = 0.003, -0.03, 0.03
    whole = craft.mass + added
    truth = {"mass": whole, "terms.payload.x": added * x / whole, "terms.payload.y": added * y / whole}
    (cause,) = verdict(nominal, craft, 12, **truth).causes
    assert cause.name == "mass"
    assert cause.parameters["mass"].value == pytest.approx(whole, abs=0.001)
    assert cause.parameters["x"].value < 0.0 < cause.parameters["y"].value


def test_sag_is_named(nominal, craft):
    there = nominal.numbers["terms.battery_sag.reference"].value
    truth = {"terms.battery_sag.sag": 0.4, "terms.battery_sag.reference": there}
    (cause,) = verdict(nominal, craft, 13, **truth).causes
    assert cause.name == "battery_sag"
    assert cause.parameters["sag"].ci95[0] < 0.4 < cause.parameters["sag"].ci95[1]


def test_a_log_that_does_not_fit_is_refused(craft):
    columns = fly(craft, np.random.default_rng(0), 8.0)
    del columns["controls"]["m4"]
    with pytest.raises(UserError, match=r"m1..m4"):
        diagnose({"flight": tables(columns)}, craft)
    columns = fly(craft, np.random.default_rng(0), 8.0)
    columns["controls"] = {k: v if k == "t" else 65535 * v for k, v in columns["controls"].items()}
    with pytest.raises(UserError, match=r"0 .. 1 would be right"):
        diagnose({"flight": tables(columns)}, craft)


def test_a_table_that_falls_is_refused(craft):
    document = {**craft.document, "rotors": [dict(rotor) for rotor in craft.document["rotors"]]}
    document["rotors"][0]["thrust"] = {"from": "command", "table": [[0, 0], [1, -1]], "unit": "N"}
    with pytest.raises(UserError, match="rise"):
        multirotor_from(document, "some.toml")


def crazypad(nominal_logs, logs, folder):
    flights = [[DATA / f"{name}.csv.gz" for name in names] for names in (nominal_logs, logs)]
    mapping = Path(__file__).parents[2] / "assets" / "mappings" / "crazypad.toml"
    good, judged = (read(paths, mapping).tables for paths in flights)
    return diagnose(judged, refit_to(load("crazyflie"), good, folder / "nominal.toml"))


@measured
@pytest.mark.parametrize("airframe", ["E8", "E9"])
def test_a_measured_normal_flight_shows_neither_weight_nor_damage(airframe, tmp_path):
    found = crazypad([f"normal_flight/{airframe}_log00"], [f"normal_flight/{airframe}_log01"], tmp_path)
    assert found.baseline.certified
    assert {cause.name for cause in found.causes} <= {"battery_sag"}
