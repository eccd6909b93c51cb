"""`helideck estimate`: flights of ours again, logs of others, and what it says."""

import json
import math
import os
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from flightlog.readers import read_flight, read_log
from helideck.cli import main
from scenarios.flight import fly
from scenarios.load import build

DATA = Path(os.environ.get("HELIDECK_DATA", Path(__file__).parents[3] / "shared" / "data"))
measured = pytest.mark.skipif(not DATA.is_dir(), reason="no measured data: set HELIDECK_DATA to its folder")

KEYS = ["log", "navigator", "variant", "topics_used", "topics_missing", "duration_s", "rejected", "height", "errors",
        "judged_by", "notes", "estimate"]  # fmt: skip


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flown") / "flight"
    scenario = build(duration_s=6.0, start={"position_m": [0.5, -0.5, 6.0]}, plan={"goal": "hover"})
    fly(scenario, seed=5, folder=folder, cameras=False)
    return folder


@pytest.fixture
def estimate(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)

    def estimate(*words):
        code = main(["estimate", *map(str, words), "--json"])
        out = capfd.readouterr()

        def constant(name):
            raise ValueError(f"{name} is no JSON")

        return code, json.loads(out.out, parse_constant=constant), out.err

    return estimate


def series(document):
    table = pq.read_table(document["estimate"])
    return {name: np.asarray(table.column(name), float) for name in table.column_names}


def without(folder, target, *topics):
    """A flight without some of its topics, and without anything that says where it came from."""
    (target / "measured").mkdir(parents=True)
    for file in (folder / "measured").glob("*.parquet"):
        if file.stem not in topics:
            shutil.copy(file, target / "measured")
    return target


# --- flights of ours -------------------------------------------------------------------------------------------------


def test_over_a_flight_s_log_the_navigator_says_again_what_it_said_in_flight_to_the_bit(flown, estimate):
    code, document, err = estimate(flown)
    assert code == 0 and err == "" and list(document) == KEYS
    again, then = series(document), read_flight(flown).measured["estimate"]
    same, rows = np.intersect1d(np.round(again["t"], 6), np.round(then["t"], 6), return_indices=True)[1:]
    assert len(same) > 100
    for column in then.columns:
        np.testing.assert_array_equal(again[column][same], then[column][rows], err_msg=column)


def test_what_it_says_of_a_flight(flown, estimate, tmp_path):
    _, document, _ = estimate(flown, "-o", tmp_path / "out")
    assert document["estimate"] == str(tmp_path / "out" / "estimate.parquet")
    assert document["topics_used"] == ["imu", "mag", "baro", "gps", "sonar", "rotor", "pad"]
    assert document["topics_missing"] == ["horizon", "flow"]
    assert document["duration_s"] == pytest.approx(6.0, abs=0.1)
    assert document["judged_by"] == "truth/state"
    truth, own = read_flight(flown).truth["state"], series(document)
    judged = own["t"] >= own["t"][0] + 0.5
    wrong = own["u"][judged] - np.interp(own["t"][judged], truth["t"], truth["u"])
    right = {"mean": np.abs(wrong).mean(), "max": np.abs(wrong).max(), "std": wrong.std(),
             "rmse": math.sqrt(np.mean(wrong**2))}  # fmt: skip
    assert document["errors"]["u"] == pytest.approx(right, rel=1e-9)
    assert list(document["errors"]) == ["e", "n", "u", "ve", "vn", "vu", "roll", "pitch", "heading"]
    assert document["errors"]["u"]["max"] < 0.15 and document["errors"]["heading"]["max"] < 0.1
    height = own["u"][own["std_u"] < 50.0]
    assert document["height"] == {"min_m": height.min(), "max_m": height.max()}


def test_the_truth_is_read_to_judge_alone(flown, estimate, tmp_path):
    _, document, _ = estimate(flown, "-o", tmp_path / "with")
    blind = shutil.copytree(flown, tmp_path / "blind")
    state = pq.read_table(blind / "truth" / "state.parquet")
    rng = np.random.default_rng(1)
    noise = {name: rng.normal(0.0, 9.0, len(state)) if name != "t" else state["t"] for name in state.column_names}
    pq.write_table(pa.table(noise), blind / "truth" / "state.parquet")
    _, other, _ = estimate(blind, "-o", tmp_path / "without")
    a, b = series(document), series(other)
    assert all(np.array_equal(a[name], b[name], equal_nan=True) for name in a)
    assert other["errors"]["u"]["rmse"] > 5.0


def test_measurements_alone_are_estimated_with_usual_sensors_and_judged_by_a_reference(flown, estimate, tmp_path):
    folder = without(flown, tmp_path / "alone", "estimate")
    truth = read_flight(flown).truth["state"]
    columns = {name: truth[name] for name in ("t", "e", "n", "u", "roll", "pitch", "heading")}
    pq.write_table(pa.table(columns), folder / "measured" / "reference.parquet")
    code, document, _ = estimate(folder)
    assert code == 0 and document["judged_by"] == "reference"
    assert document["errors"]["u"]["rmse"] < 1.5 and document["errors"]["roll"]["max"] < 0.05
    assert "pad" in document["topics_used"]


def test_without_inertial_samples_height_and_position_come_from_what_there_is(flown, estimate, tmp_path):
    folder = without(flown, tmp_path / "thin", "imu", "mag", "rotor", "pad")
    code, document, _ = estimate(folder)
    assert code == 0 and document["topics_used"] == ["baro", "gps", "sonar"] and "imu" in document["topics_missing"]
    own, truth = series(document), read_flight(flown).truth["state"]
    late = own["t"] > 2.0
    for axis, most in (("u", 2.5), ("e", 2.5), ("n", 2.5)):
        wrong = own[axis][late] - np.interp(own["t"][late], truth["t"], truth[axis])
        assert np.abs(wrong).max() < most
        assert np.sqrt(np.mean((wrong / own[f"std_{axis}"][late]) ** 2)) < 2.5
    assert np.isfinite(own["roll"]).all()  # the vehicle's own


def test_the_published_navigators_run_over_a_log_too(flown, estimate):
    for name in ("lei2012",):
        code, document, _ = estimate(flown, "--navigator", name, "--variant", "published")
        assert code == 0 and (document["navigator"], document["variant"]) == (name, "published")
        assert document["errors"]["u"]["rmse"] < 3.0


# --- what cannot be --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["nowhere"], "nowhere: no such log"),
        (["{flown}", "--navigator", "none"], "navigator: there is none named 'none'"),
        (["{flown}", "--mapping", "crazypat"], "crazypat: no such mapping file; did you mean 'crazypad'?"),
        (["{flown}", "--vehicle", "nothing"], "unknown vehicle 'nothing'"),
        (["{thin}", "--navigator", "lei2012"], "cannot do without an imu"),
        (["{poor}"], "nothing to estimate from"),
    ],
)
def test_unusable_input_is_one_line_and_exit_code_2(flown, estimate, tmp_path, words, says):
    without(flown, tmp_path / "thin", "imu")
    without(flown, tmp_path / "poor", "imu", "baro", "gps", "sonar")
    paths = {"flown": flown, "thin": tmp_path / "thin", "poor": tmp_path / "poor"}
    code, document, err = estimate(*(word.format(**paths) for word in words))
    assert code == 2 and says in document["error"]
    assert err == f"helideck: {document['error']}\n" and "\n" not in document["error"]


def test_a_hover_of_a_hundred_g_is_named_with_its_unit(flown, estimate, tmp_path):
    folder = without(flown, tmp_path / "cm")
    imu = pq.read_table(folder / "measured" / "imu.parquet")
    for index, name in enumerate(imu.column_names):
        if name in ("fx", "fy", "fz"):
            imu = imu.set_column(index, name, pa.array(100.0 * np.asarray(imu[name])))
    pq.write_table(imu, folder / "measured" / "imu.parquet")
    code, document, _ = estimate(folder)
    assert code == 2 and "median |f| is 99" in document["error"] and "cm/s^2" in document["error"]


# --- logs of others --------------------------------------------------------------------------------------------------


def changed(tables, place, topic, **columns):
    """Tables as a folder that is measured alone, one of them with other rows."""
    folder = place / f"changed-{topic}" / "measured"
    folder.mkdir(parents=True)
    for name, table in tables.items():
        pq.write_table(pa.table(columns) if name == topic else table.arrow, folder / f"{name}.parquet")
    return folder.parent


@measured
def test_false_echoes_of_a_helicopter_do_not_pull_its_height(estimate, tmp_path):
    path = DATA / "ardupilot" / "tradheli_brownout.log"
    code, document, _ = estimate(path)
    assert code == 0 and document["topics_used"] == ["baro", "gps", "sonar"] and document["errors"] is None
    tables, own = read_log(path).tables, series(document)
    sonar, baro, gps = tables["sonar"], tables["baro"], tables["gps"]
    assert own["t"][0] == pytest.approx(baro["t"][0], abs=0.1)  # the log's own clock
    t = sonar["t"]
    height, other = np.interp(t, own["t"], own["u"]), baro["altitude"]
    apart = np.abs(sonar["range"] - other) > 3.0
    assert apart.sum() == 273
    ground = np.median(gps["height"][gps["t"] < gps["t"][0] + 15.0])
    satellites = np.interp(t, gps["t"], gps["height"] - ground)
    low, high = np.minimum(other, satellites) - 2.0, np.maximum(other, satellites) + 2.0
    assert np.all((height >= low) & (height <= high) | ~apart)
    # not pulled: without these echoes it is the same
    heard = sonar["valid"].astype(bool) & ~(apart & (other > 20.0))
    assert np.count_nonzero(~heard) > 150
    folder = changed(tables, tmp_path, "sonar", t=t, range=np.where(heard, sonar["range"], np.nan), valid=heard)
    _, document, _ = estimate(folder)
    assert np.abs(series(document)["u"] - own["u"]).max() < 0.2


@measured
def test_a_barometer_s_glitches_do_not_move_the_height(estimate, tmp_path):
    """What each jump does: the fused height against the satellites', over the second that follows."""
    path = DATA / "ardupilot" / "robert_lefebvre_octo_PM.log"
    code, document, _ = estimate(path)
    assert code == 0
    tables, own = read_log(path).tables, series(document)
    baro, gps = tables["baro"], tables["gps"]
    jumps = np.flatnonzero(np.abs(np.diff(baro["altitude"])) > 20.0)
    assert len(jumps) == 21
    for index in jumps:
        start = baro["t"][index]
        after = np.linspace(start, start + 1.0, 26)
        fused = np.interp(after, own["t"], own["u"]) - np.interp(start, own["t"], own["u"])
        flown = np.interp(after, gps["t"], gps["u"]) - np.interp(start, gps["t"], gps["u"])
        assert np.abs(fused - flown).max() < 1.25
    # and without what the barometer said in the two seconds about each jump
    t = baro["t"]
    sound = np.abs(t[:, None] - t[jumps]).min(axis=1) > 1.0
    folder = changed(tables, tmp_path, "baro", t=t[sound], altitude=baro["altitude"][sound])
    calm = series(estimate(folder)[1])
    inside = (own["t"] >= t[jumps[0]] - 2.0) & (own["t"] <= t[jumps[-1]] + 1.0)
    moved = np.abs(own["u"] - np.interp(own["t"], calm["t"], calm["u"]))[inside]
    assert moved.max() < 1.0


@measured
def test_a_quadrotor_s_drifting_satellites_are_not_followed(estimate):
    code, document, _ = estimate(DATA / "arducopter" / "00000081.BIN")
    assert code == 0 and document["topics_used"] == ["imu", "mag", "baro", "gps"]
    own = series(document)
    tables = read_log(DATA / "arducopter" / "00000081.BIN").tables
    baro, theirs = tables["baro"], tables["estimate"]
    apart = np.interp(baro["t"], own["t"], own["u"]) - baro["altitude"]
    assert np.abs(apart).max() < 2.5  # the satellites walk off by 7 m
    upright = theirs["t"] < 75.0  # then it lies on its side
    for angle in ("roll", "pitch"):
        wrong = np.abs(np.degrees(np.interp(theirs["t"], own["t"], own[angle]) - theirs[angle])[upright])
        # 25 samples a second of a shaken gyroscope, against a filter that had 400
        assert np.median(wrong) < 3.0 and np.percentile(wrong, 95) < 8.0


@measured
@pytest.mark.parametrize(("folder", "name"), [("lab_helicopter", "lab_helicopter"), ("crazypad", "crazypad")])
def test_logs_without_a_height_sensor_say_so(estimate, folder, name):
    path = next(path for path in sorted((DATA / folder).rglob("*.csv*")))
    code, document, _ = estimate(path, "--mapping", name)
    assert code == 2 and "nothing to estimate from" in document["error"]
