import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flightlog.errors import UserError
from flightlog.readers import read_flight, read_log
from flightlog.recorder import Recorder, write_flight


def write(folder, name, table, group="measured"):
    (folder / group).mkdir(exist_ok=True)
    pq.write_table(pa.table(table), folder / group / f"{name}.parquet")


@pytest.fixture
def flight(tmp_path):
    write_flight(tmp_path, {"seed": 5})
    (tmp_path / "measured").mkdir()
    return tmp_path


def test_columns_by_name(flight):
    write(flight, "sonar", {"t": [0.0, 0.1], "range": [1.0, 2.0], "valid": [True, False]})
    found = read_flight(flight)
    assert found.document == {"seed": 5}
    assert list(found.measured) == ["sonar"]
    sonar = found.measured["sonar"]
    assert sonar["range"].tolist() == [1.0, 2.0]
    assert sonar["valid"].dtype == bool
    assert sonar.unit("range") == "m"
    with pytest.raises(ValueError, match="read-only"):
        sonar["range"][0] = 3.0


def test_missing_columns_are_nan_and_further_ones_are_kept(flight):
    write(flight, "imu", {"t": [0.0, 1.0], "fz": [9.8, 9.7], "humidity": [40.0, 41.0]})
    imu = read_flight(flight).measured["imu"]
    assert np.isnan(imu["fx"]).all()
    assert imu["fx"].shape == (2,)
    assert imu["humidity"].tolist() == [40.0, 41.0]
    assert "fx" not in imu
    with pytest.raises(KeyError, match="imu has no column 'speed'; it has t, fz, humidity"):
        imu["speed"]


def test_other_types_and_gaps_become_numbers(flight):
    table = {"t": pa.array([0, 1], pa.int32()), "fz": pa.array([9.5, None], pa.float32())}
    write(flight, "imu", table)
    write(flight, "gps", {"t": [0.0, 1.0], "satellites": pa.array([7, None]), "valid": pa.array([1, 0], pa.int8())})
    found = read_flight(flight).measured
    assert found["imu"]["t"].dtype == float
    np.testing.assert_array_equal(found["imu"]["fz"], [9.5, np.nan])
    np.testing.assert_array_equal(found["gps"]["satellites"], [7.0, np.nan])
    assert found["gps"]["valid"].tolist() == [True, False]


def test_rows_are_sorted_by_time_and_the_disorder_told(flight):
    write(flight, "mag", {"t": [0.0, 0.2, 0.1, 0.3, 0.3], "mx": [0.0, 2.0, 1.0, 3.0, 4.0]})
    found = read_flight(flight)
    assert found.measured["mag"]["t"].tolist() == [0.0, 0.1, 0.2, 0.3, 0.3]
    assert found.measured["mag"]["mx"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]  # of two at one time the first stays first
    assert found.notes == [
        "measured/mag: 1 backward step(s) in time; rows sorted",
        "measured/mag: 1 repeated time(s)",
    ]


def test_rows_of_one_time_keep_their_order_however_many(flight):
    t = np.repeat([0.5, 0.0, 0.25], 500)  # falls back by less than a reset
    write(flight, "mag", {"t": t, "mx": np.arange(1500.0)})
    mx = read_flight(flight).measured["mag"]["mx"]
    assert mx.tolist() == [*range(500, 1000), *range(1000, 1500), *range(500)]


def test_rows_without_a_time_are_left_out_and_told(flight):
    write(flight, "mag", {"t": [0.0, None, 0.2, float("nan")], "mx": [0.0, 1.0, 2.0, 3.0]})
    found = read_flight(flight)
    assert found.measured["mag"]["mx"].tolist() == [0.0, 2.0]
    assert found.notes == ["measured/mag: 2 rows without a time left out"]


def test_a_reset_clock_splits_the_table(flight):
    t = [*np.arange(50.0, 60.0, 0.1), *np.arange(0.0, 5.0, 0.1)]
    write(flight, "mag", {"t": t, "mx": np.arange(len(t)) * 1.0})
    found = read_flight(flight)
    mag = found.measured["mag"]
    assert mag.segments == (0, 100)
    assert mag["mx"].tolist() == list(range(150))
    assert mag.segment(0)["t"][-1] == pytest.approx(59.9)
    assert mag.segment(1)["t"][0] == 0.0
    assert len(mag.segment(1)) == 50
    assert found.notes == [
        "measured/mag: the clock was reset 1 time(s); segments start again at 0.000 s (row 100)"
    ]  # fmt: skip


def test_one_very_late_row_is_no_reset(flight):
    write(flight, "mag", {"t": [0.0, 5.0, 10.0, 1.0, 15.0], "mx": [0.0, 1.0, 2.0, 3.0, 4.0]})
    mag = read_flight(flight).measured["mag"]
    assert mag.segments == (0,)
    assert mag["mx"].tolist() == [0.0, 3.0, 1.0, 2.0, 4.0]


@given(st.lists(st.floats(0, 100, width=32), min_size=1, max_size=40))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
def test_any_order_of_times_loses_no_row_and_rises_within_segments(flight, times):
    write(flight, "mag", {"t": times, "mx": np.arange(len(times)) * 1.0})
    mag = read_flight(flight).measured["mag"]
    assert sorted(zip(mag["t"], mag["mx"], strict=True)) == sorted(zip(times, range(len(times)), strict=True))
    for k in range(len(mag.segments)):
        segment = mag.segment(k)
        assert len(segment) > 0
        assert np.all(np.diff(segment["t"]) >= 0)
        ties = np.diff(segment["t"]) == 0
        assert np.all(np.diff(segment["mx"])[ties] > 0)


def record(folder, rows, flush_every):
    recorder = Recorder(folder)
    write_flight(folder, {})
    for k in range(rows):
        recorder.topic("measured", "baro").append((k / 25, 1e5, 288.0, float(k)))
        if k % flush_every == flush_every - 1:
            recorder.flush()
    return folder / "measured" / "baro.arrows"


@given(st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None)
def test_a_stream_cut_anywhere_gives_its_whole_batches(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("cut") / "flight"
    stream = record(folder, 100, 20)
    size = stream.stat().st_size
    kept = data.draw(st.integers(0, size))
    with stream.open("r+b") as file:
        file.truncate(kept)
    found = read_flight(folder)
    if "baro" in found.measured:
        rows = found.measured["baro"]["altitude"]
        assert len(rows) % 20 == 0
        assert rows.tolist() == list(range(len(rows)))
        assert len(rows) >= 20 * (kept * 5 // size - 1)
    else:
        assert kept < 0.4 * size
    assert len(found.notes) == 1
    assert "broken off" in found.notes[0]


def test_the_finished_file_is_preferred_to_the_stream(flight):
    stream = record(flight / "other", 20, 20)
    (flight / "measured/baro.arrows").write_bytes(stream.read_bytes())
    write(flight, "baro", {"t": [0.0], "altitude": [7.0]})
    found = read_flight(flight)
    assert found.measured["baro"]["altitude"].tolist() == [7.0]
    assert found.notes == []


@pytest.mark.parametrize(
    ("file", "content", "says"),
    [
        ("imu.parquet", b"this is text, not a table", "not a Parquet file"),
        ("imu.parquet", b"", "not a Parquet file"),
        ("imu.arrows", b"this is text, not a table", "not an Arrow stream"),
    ],
)
def test_a_file_of_another_kind_is_named(flight, file, content, says):
    (flight / "measured" / file).write_bytes(content)
    with pytest.raises(UserError, match=says) as caught:
        read_flight(flight)
    assert str(flight / "measured" / file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_table_without_time_or_with_words_for_numbers_is_named(flight):
    write(flight, "imu", {"time": [0.0]})
    with pytest.raises(UserError, match=r"imu\.parquet: no column t; it has time"):
        read_flight(flight)
    write(flight, "imu", {"t": [0.0], "fx": ["fast"]})
    with pytest.raises(UserError, match=r"imu\.parquet: column fx is string; a number would be right"):
        read_flight(flight)
    write(flight, "imu", {"t": ["noon"]})
    with pytest.raises(UserError, match=r"imu\.parquet: column t is string; a number would be right"):
        read_flight(flight)


def test_truth_is_opened_only_when_asked(flight):
    (flight / "truth").mkdir()
    (flight / "truth/state.parquet").write_bytes(b"broken")
    found = read_flight(flight)  # does not touch it
    with pytest.raises(UserError, match="not a Parquet file"):
        _ = found.truth


def test_truth_stays_closed_to_who_must_not_see_it(flight):
    write(flight, "state", {"t": [0.0], "u": [10.0]}, group="truth")
    assert read_flight(flight).truth["state"]["u"].tolist() == [10.0]
    with pytest.raises(PermissionError, match="closed"):
        _ = read_flight(flight, truth=False).truth


def test_a_flight_without_truth_has_none(flight):
    assert len(read_flight(flight).truth) == 0


def test_a_folder_without_measurements_is_named(tmp_path):
    write_flight(tmp_path, {})
    with pytest.raises(UserError, match=r"no measured/ in it"):
        read_flight(tmp_path)


def test_an_unknown_topic_is_told_with_the_known(flight):
    write(flight, "mag", {"t": [0.0]})
    with pytest.raises(KeyError, match="no topic 'compass'; there is mag"):
        _ = read_flight(flight).measured["compass"]


def test_a_stream_whose_column_has_a_broken_name_is_one_clear_line(tmp_path):
    folder = tmp_path / "flight"
    stream = record(folder, 60, 20)
    whole = stream.read_bytes()
    assert b"pressure" in whole
    stream.write_bytes(whole.replace(b"pressure", b"\x80ressure"))
    with pytest.raises(UserError, match="a column's name is no text"):
        read_log(folder)


@given(st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None)
def test_a_folder_broken_anywhere_is_a_log_or_one_clear_line(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("broken") / "flight"
    stream = record(folder, 60, 20)
    write(folder, "gps", {"t": np.arange(30) * 0.2, "u": np.arange(30) * 1.0})
    file = data.draw(st.sampled_from([stream, folder / "measured/gps.parquet", folder / "flight.json"]))
    whole = bytearray(file.read_bytes())
    at = data.draw(st.integers(0, len(whole) - 1))
    if data.draw(st.booleans()):
        del whole[at:]
    else:
        noise = data.draw(st.binary(min_size=1, max_size=20))
        whole[at : at + len(noise)] = noise
    file.write_bytes(whole)
    try:
        read_log(folder)
    except UserError as error:
        assert str(folder) in str(error) and "\n" not in str(error)
