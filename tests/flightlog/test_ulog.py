"""PX4's logs: a flight of Helideck's written as one comes back as it was."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from flightlog.errors import UserError
from flightlog.geodesy import LocalFrame
from flightlog.readers import read_flight, read_log
from flightlog.rotations import from_angles
from scenarios.flight import fly
from scenarios.load import build
from sim.multirotor import load_multirotor
from sim.multirotor.simulate import fly as hovering
from tests.flightlog.log_writers import ulog

FUZZ = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)

HOME = LocalFrame(47.3977, 8.5456, 488.0)
NED = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD = Rotation.from_quat([1.0, 0.0, 0.0, 0.0])


def stamps(t):
    return "uint64_t", np.round(1e6 * t).astype(np.uint64)


def attitude(roll, pitch, heading):
    """Quaternion wxyz (N, 4), forward, right, down to north, east, down."""
    return (NED.inv() * from_angles(roll, pitch, heading) * FRD.inv()).as_quat()[:, [3, 0, 1, 2]]


def revolutions(speed):
    """Turns a minute."""
    return speed * 30.0 / np.pi


def as_ulog(tables):
    """A flight's topics as the firmware would have logged them."""
    imu, mag, baro, gps, sonar, rotor, own = (
        tables[name] for name in ("imu", "mag", "baro", "gps", "sonar", "rotor", "estimate")
    )
    lat, lon, alt = HOME.geographic(gps["e"], gps["n"], gps["u"])
    double, single = "double", "float"
    position = {"x": own["n"], "y": own["e"], "z": -own["u"], "vx": own["vn"], "vy": own["ve"], "vz": -own["vu"],
                "ax": own["an"], "ay": own["ae"], "az": -own["au"]}  # fmt: skip
    rows = np.ones(len(own))
    return ulog(
        {
            ("sensor_combined", 0): {
                "timestamp": stamps(imu["t"]),
                "gyro_rad[3]": (single, imu.stack("wx", "wy", "wz") * [1, -1, -1]),
                "accelerometer_m_s2[3]": (single, imu.stack("fx", "fy", "fz") * [1, -1, -1]),
            },
            ("vehicle_magnetometer", 0): {
                "timestamp": stamps(mag["t"]),
                "magnetometer_ga[3]": (single, mag.stack("mx", "my", "mz") * [0.01, -0.01, -0.01]),
            },
            ("vehicle_air_data", 0): {
                "timestamp": stamps(baro["t"]),
                "baro_alt_meter": (single, baro["altitude"] + 488.0),
                "baro_temp_celcius": (single, baro["temperature"] - 273.15),
                "baro_pressure_pa": (single, baro["pressure"]),
            },
            ("vehicle_gps_position", 0): {
                "timestamp": stamps(gps["t_arrival"]),
                "timestamp_sample": stamps(gps["t"]),
                "latitude_deg": (double, lat), "longitude_deg": (double, lon), "altitude_msl_m": (double, alt),
                "vel_n_m_s": (single, gps["vn"]), "vel_e_m_s": (single, gps["ve"]), "vel_d_m_s": (single, -gps["vu"]),
                "hdop": (single, gps["hdop"]),
                "fix_type": ("uint8_t", np.where(gps["valid"], 3, 0)),
                "satellites_used": ("uint8_t", gps["satellites"]),
            },
            ("distance_sensor", 0): {
                "timestamp": stamps(sonar["t"]),
                "current_distance": (single, sonar["range"]),
                "min_distance": (single, np.full(len(sonar), 0.1)), "max_distance": (single, np.full(len(sonar), 3.1)),
                "orientation": ("uint8_t", np.full(len(sonar), 25)),
            },
            ("esc_status", 0): {
                "timestamp": stamps(rotor["t"]),
                "esc_count": ("uint8_t", np.ones(len(rotor))),
                "esc[8].esc_rpm": ("int32_t", np.round(revolutions(rotor["speed"])[:, None] * (np.arange(8) == 0))),
            },
            ("vehicle_local_position", 0): {
                "timestamp": stamps(own["t"]),
                **{name: (single, values) for name, values in position.items()},
                "ref_lat": (double, HOME.latitude * rows), "ref_lon": (double, HOME.longitude * rows),
                "ref_alt": (single, HOME.altitude * rows),
                "xy_global": ("bool", rows), "z_global": ("bool", rows),
            },
            ("vehicle_attitude", 0): {
                "timestamp": stamps(own["t"]),
                "q[4]": (single, attitude(own["roll"], own["pitch"], own["heading"])),
            },
        },
        parameters={"EKF2_MAG_DECL": 2.5},
    )  # fmt: skip


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ulog")
    fly(build(duration_s=4.0, start={"position_m": [0.5, -0.5, 2.6]}), seed=5, folder=folder / "flight", cameras=False)
    tables = read_flight(folder / "flight", truth=False).measured
    (folder / "flight.ulg").write_bytes(as_ulog(tables))
    return folder, tables


TOLERANCES = {  # single precision, and microseconds
    "imu": 1e-5, "mag": 1e-5, "baro": 1e-2, "gps": 1e-5, "sonar": 1e-6, "estimate": 1e-5,
    "rotor": 0.06,  # whole turns a minute
}  # fmt: skip


@pytest.mark.parametrize("topic", TOLERANCES)
def test_a_flight_of_ours_comes_back(flight, topic):
    folder, tables = flight
    log = read_log(folder / "flight.ulg")
    assert log.kind == "ulog" and log.timed == log.tables.keys()
    found, right = log.tables[topic], tables[topic]
    np.testing.assert_allclose(found["t"], right["t"], atol=1e-6)
    for column in right.columns:
        if column.startswith(("std_", "t")) and column != "temperature":
            continue
        values, wanted = found[column].astype(float), right[column].astype(float)
        if (topic, column) == ("baro", "altitude"):
            wanted = wanted - wanted[0]
            np.testing.assert_allclose(values, wanted, atol=1e-4)
            continue
        if topic == "sonar":
            heard = right["valid"]
            assert np.array_equal(found["valid"], heard)
            values, wanted = values[heard], wanted[heard]
        if column == "heading":
            values, wanted = np.unwrap(values), np.unwrap(wanted)
        np.testing.assert_allclose(values, wanted, atol=TOLERANCES[topic], rtol=1e-6, err_msg=column)
    if topic == "gps":
        np.testing.assert_allclose(found["t_arrival"], right["t_arrival"], atol=1e-6)


@pytest.mark.parametrize("outputs", ["actuator_motors", "actuator_outputs"])
def test_a_multirotor_s_flight_comes_back(tmp_path, outputs):
    craft = load_multirotor("crazyflie")
    flown = hovering(craft, np.random.default_rng(2), 3.0)
    t, battery = flown["controls"]["t"], flown["battery"]
    commands = np.column_stack([flown["controls"][f"m{i}"] for i in range(1, 5)])
    speeds = 1500.0 + 500.0 * commands
    if outputs == "actuator_motors":
        sent = {"control[12]": ("float", np.column_stack([commands, np.full((len(t), 8), np.nan)]))}
    else:
        pulses = np.column_stack([1000.0 + 1000.0 * commands, np.zeros((len(t), 12))])
        sent = {"noutputs": ("uint32_t", np.full(len(t), 4)), "output[16]": ("float", pulses)}
    path = tmp_path / "quad.ulg"
    path.write_bytes(ulog({
        (outputs, 0): {"timestamp": stamps(t), **sent},
        ("battery_status", 0): {"timestamp": stamps(battery["t"]), "voltage_v": ("float", battery["voltage"])},
        ("esc_status", 0): {
            "timestamp": stamps(t), "esc_count": ("uint8_t", np.full(len(t), 4)),
            "esc[8].esc_rpm": ("int32_t", np.round(revolutions(np.column_stack([speeds, 0.0 * speeds])))),
        },
    }))  # fmt: skip
    log = read_log(path)
    assert sorted(log.tables) == ["battery", "controls", "rotor"]
    np.testing.assert_allclose(log.tables["controls"]["t"], t, atol=1e-6)
    np.testing.assert_allclose(log.tables["battery"]["voltage"], battery["voltage"], atol=1e-5)
    for i in range(4):
        np.testing.assert_allclose(log.tables["controls"][f"m{i + 1}"], commands[:, i], atol=1e-6)
        np.testing.assert_allclose(log.tables["rotor"][f"speed{i + 1}"], speeds[:, i], atol=0.06)


def test_parameters_and_motor_commands(tmp_path):
    t = np.arange(0.0, 2.0, 0.02)
    control = np.full((len(t), 12), np.nan)
    control[:, :4] = 0.5 + 0.1 * np.sin(t)[:, None]
    path = tmp_path / "quad.ulg"
    path.write_bytes(ulog({
        ("actuator_motors", 0): {"timestamp": stamps(t), "control[12]": ("float", control)},
        ("battery_status", 0): {"timestamp": stamps(t), "voltage_v": ("float", 15.0 - t), "current_a": ("float", t)},
        ("vehicle_optical_flow", 0): {
            "timestamp": stamps(t), "pixel_flow[2]": ("float", np.column_stack([0.01 * t, -0.02 * t])),
            "integration_timespan_us": ("uint32_t", np.full(len(t), 20_000)),
            "quality": ("uint8_t", np.full(len(t), 255)),
        },
        ("distance_sensor", 1): {
            "timestamp": stamps(t), "current_distance": ("float", t), "orientation": ("uint8_t", np.zeros(len(t))),
        },
    }, {"EKF2_MAG_DECL": 2.5}))  # fmt: skip
    log = read_log(path)
    assert sorted(log.tables) == ["battery", "controls", "flow"]  # a sensor that looks ahead is no sonar
    assert log.tables["controls"].columns == ("t", "m1", "m2", "m3", "m4")
    np.testing.assert_allclose(log.tables["flow"]["v"], -0.02 * t, atol=1e-7)
    np.testing.assert_allclose(log.tables["flow"]["dt"], 0.02)
    assert log.tables["flow"]["quality"].max() == 1.0
    assert log.document["parameters"]["EKF2_MAG_DECL"] == 2.5


def test_what_flow_means_is_what_our_camera_sees():
    """A vehicle that only turns: the firmware's angles about body axes are the picture's motion along ours."""
    from flightlog.camera import CameraMount

    mount = CameraMount.downward((0, 0, 0))
    point = np.array([0.0, 0.0, -10.0])  # still ground below, in body axes before the turn
    for axis, picture in ((np.array([1.0, 0, 0]), 0), (np.array([0, -1.0, 0]), 1)):  # forward; right is -y
        turned = Rotation.from_rotvec(1e-4 * axis).inv().apply(point)
        seen = mount.axes.T @ turned
        assert (seen[:2] / seen[2])[picture] == pytest.approx(1e-4, rel=1e-3)


@given(st.data())
@FUZZ
def test_cut_or_broken_anywhere_it_is_a_log_or_one_clear_line(flight, data):
    folder, tables = flight
    whole = bytearray((folder / "flight.ulg").read_bytes()[:30_000])
    kind = data.draw(st.sampled_from(["cut", "broken"]))
    start = data.draw(st.integers(0, len(whole) - 1))
    if kind == "cut":
        del whole[start:]
    else:
        noise = data.draw(st.binary(min_size=1, max_size=30))
        whole[start : start + len(noise)] = noise
    path = folder / "other.ulg"
    path.write_bytes(whole)
    try:
        log = read_log(path)
    except UserError as error:
        assert str(path) in str(error) and "\n" not in str(error)
        return
    if kind == "cut":
        for topic, table in log.tables.items():
            assert len(table) <= len(tables[topic])


def test_the_parser_says_nothing_on_stdout(flight, capfd):
    folder, _ = flight
    (folder / "cut.ulg").write_bytes((folder / "flight.ulg").read_bytes()[:20_001])
    read_log(folder / "cut.ulg")
    assert capfd.readouterr().out == ""


def test_a_message_that_claims_more_than_there_is_does_not_hold_the_reader_up(flight):
    """Of no type, a byte longer than the rest of the file, among the definitions: the parser would go round."""
    folder, _ = flight
    whole = (folder / "flight.ulg").read_bytes()
    path = folder / "round.ulg"
    definitions = whole[: whole.index(b"\x12\0A\0\0\0sensor_combined")]
    path.write_bytes(definitions + (11).to_bytes(2, "little") + b"\0" + bytes(10))
    with pytest.raises(UserError, match=r"round\.ulg: not a sound ULog: no message can be read beyond byte"):
        read_log(path)


def test_an_array_without_end_is_refused_before_it_is_built(tmp_path):
    path = tmp_path / "huge.ulg"
    body = b"huge:uint64_t timestamp;float[900000000] x;"
    path.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8) + len(body).to_bytes(2, "little") + b"F" + body)
    with pytest.raises(UserError, match="declares an array of"):
        read_log(path)
