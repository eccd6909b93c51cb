"""Causes of sensors: what the simulator makes of them, and what a diagnosis that knows of them takes out again."""

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flightlog.constants import GRAVITY
from flightlog.marks import HMark
from flightlog.rotations import matrix, quaternion
from flightlog.tables import Table, table
from identification.causes import CATALOGUE, TOLD
from identification.corrections import corrected
from scenarios.logbook import TOPICS
from scenarios.schema import Scenario, WeatherTable
from scenarios.staging import expected_weather
from sim import vehicle as vehicles
from sim.linearisation import trim
from sim.pipeline import Pipeline
from sim.sensors import CATALOGUE as SENSORS
from sim.sensors.contract import Truth
from sim.sensors.faults import stamped
from sim.sensors.pad_camera import PadCamera, by_lens
from sim.terms import CATALOGUE as TERMS
from sim.vehicle import Vehicle
from sim.weather import Weather
from sim.wind import Wind
from sim.wind.mean import mean_speed
from sim.world import MAGNETIC_FIELD

RAPTOR = vehicles.load("raptor90")
PRESSURE, TEMPERATURE = 101325.0, 288.15
CONTRACT = {  # names of the catalogue that the design fixes
    "ground_effect", "thrust_scale", "mass", "fuel_burn", "cg_offset", "drag", "wind", "actuator_lag",
    "actuator_deadband", "actuator_delay", "rotor_droop", "battery_sag", "vortex_ring", "tail_rotor_force",
    "flapping_lag", "rotor_damage", "joint_friction", "joint_stiffness", "input_nonlinearity", "baro_drift",
    "baro_downwash", "baro_lag", "baro_glitch", "gps_bias", "gps_drift", "gps_latency", "camera_latency",
    "clock_offset", "sonar_scale", "sonar_false_echo", "imu_bias", "imu_scale", "imu_misalignment", "mag_bias",
    "camera_focal", "camera_tilt", "lens_distortion",
}  # fmt: skip


def truth(t: float) -> Truth:
    rotation = matrix(quaternion(0.1 * np.sin(t), 0.08 * np.cos(0.7 * t), 0.3 * t))
    return Truth(
        t=t, position=np.array([0.6 + 0.2 * np.sin(t), -0.5, 2.5 + 0.3 * np.cos(t)]),
        velocity=np.array([0.2, 0.1, 0.0]),
        quaternion=quaternion(0.1 * np.sin(t), 0.08 * np.cos(0.7 * t), 0.3 * t), rotation=rotation,
        rates=np.array([0.1, -0.2, 0.3]), angular_acceleration=np.zeros(3),
        specific_force=np.array([0.3, -0.2, 9.8 + 0.5 * np.sin(t)]), rotor_speed=157.0, thrust=49.0, inflow=3.5,
        wind=np.zeros(3), pressure=PRESSURE, temperature=TEMPERATURE,
    )  # fmt: skip


def seen(craft: Vehicle, topic: str, samples: int = 60) -> Table:
    """What one sensor of a vehicle says; the same random numbers every time."""
    fitted, rng = craft.sensors[topic], np.random.default_rng(7)
    site = craft.site(PRESSURE, TEMPERATURE, MAGNETIC_FIELD)
    if topic == "pad":
        camera = craft.cameras["down"]
        numbers = dict(fitted.numbers) | {
            "focal_scale": camera.focal_scale, "k1": camera.k1_error, "delay": camera.stamp_delay
        }  # fmt: skip
        device: Any = PadCamera(numbers, camera.mount.position, site, rng, camera=camera.model, mount=camera.mount,
                                mark=HMark())  # fmt: skip
    else:
        device = SENSORS[topic](fitted.numbers, fitted.position, site, rng)
    rows = []
    for i in range(samples):
        sample = device.sample(truth(i * 0.2))
        if sample is not None:
            moved: Any = stamped(sample, fitted.numbers.get("clock", 0.0))
            rows.append(tuple(moved))
    kinds = {name: kind for kind, name in TOPICS.items()}
    return table("measured", topic, rows, kinds[topic]._fields)  # type: ignore[attr-defined]


def with_number(key: str, value: float, unit: str) -> Vehicle:
    document = copy.deepcopy(dict(RAPTOR.document))
    *way, name = key.split(".")
    entry: Any = document
    for part in way:
        entry = entry[part]
    entry[name] = {"value": value, "unit": unit}
    return vehicles.from_document(document, RAPTOR.path)


ERRORS = [
    ("imu", "sensors.imu.bias_fy", 0.4, "m/s^2", 1e-9), ("imu", "sensors.imu.scale_wz", 1.05, "1", 1e-3),
    ("imu", "sensors.imu.misalignment_x", 0.02, "rad", 5e-3), ("imu", "sensors.imu.clock", 0.03, "s", 1e-9),
    ("mag", "sensors.mag.bias_y", 3.0, "uT", 1e-9), ("mag", "sensors.mag.clock", 0.1, "s", 1e-9),
    ("baro", "sensors.baro.drift_rate", 0.1, "m/s", 0.02), ("baro", "sensors.baro.clock", -0.2, "s", 1e-9),
    ("gps", "sensors.gps.bias_n", -4.0, "m", 1e-9), ("gps", "sensors.gps.drift_rate_u", 0.05, "m/s", 0.02),
    ("gps", "sensors.gps.delay", 0.15, "s", 1e-9), ("sonar", "sensors.sonar.scale", 1.05, "1", 0.003),
    ("rotor", "sensors.rotor.scale", 0.97, "1", 1e-9), ("pad", "cameras.down.focal_scale", 1.03, "1", 0.008),
    ("pad", "cameras.down.stamp_delay", 0.04, "s", 1e-9), ("pad", "cameras.down.k1", 0.08, "1", 0.013),
    ("pad", "cameras.down.roll", 0.03, "rad", 0.004), ("pad", "cameras.down.pitch", -0.02, "rad", 0.004),
]  # fmt: skip


@pytest.mark.parametrize(("topic", "key", "value", "unit", "close"), ERRORS)
def test_what_the_file_knows_of_an_error_is_taken_out(
    topic: str, key: str, value: float, unit: str, close: float
) -> None:
    """Planted once: the sign of the turn of the case."""
    sound, odd = seen(RAPTOR, topic), seen(with_number(key, value, unit), topic)
    mended = corrected({topic: odd}, with_number(key, value, unit))[topic]
    names = [name for name in sound if name not in ("source", "quality", "valid") and not name.startswith("std_")]
    off = {name: np.nanmax(np.abs(np.asarray(odd[name], float) - np.asarray(sound[name], float))) for name in names}
    left = {name: np.nanmax(np.abs(np.asarray(mended[name], float) - np.asarray(sound[name], float))) for name in names}
    left.pop("angle", None)
    left.pop("pressure", None)
    assert max(off.values()) > 3.0 * close
    assert max(left.values()) < close, left


def test_a_sound_file_changes_nothing() -> None:
    for topic in ("imu", "mag", "baro", "gps", "sonar", "rotor", "pad"):
        rows = seen(RAPTOR, topic, 5)
        assert corrected({topic: rows}, RAPTOR)[topic] is rows


def test_a_lens_moves_a_mark_along_its_ray_and_makes_it_larger_at_the_rim() -> None:
    """A mark that is nearly a point: k1 r^2 outward, larger by 1 + k1 r^2 along the rim and 1 + 3 k1 r^2 across."""
    camera = RAPTOR.cameras["down"]
    free = dict(RAPTOR.sensors["pad"].numbers) | {"predicted_std": 10.0, "predicted_angle_std": 10.0, "tilt_std": 1e-5,
                                                  "bleed_std": 1e-3}  # fmt: skip
    mount, model = camera.mount, replace(camera.model, width=8000, height=8000, cx=4000.0, cy=4000.0)
    heights, aside = np.array([12.0, 12.0, 25.0]), np.array([0.0, 3.0, 6.0])
    positions = np.column_stack([-aside, 0.0 * aside, heights - mount.position[2]])
    found = by_lens(positions, np.broadcast_to(np.eye(3), (3, 3, 3)), model, mount, HMark(), free)
    # level, nose to the east in body axes: forward is the picture's -y
    tangent = aside / heights
    assert np.allclose(found[0, :2], 0.0, atol=1e-6)
    share = -found[1:, 2] / heights[1:]
    assert np.all((share > tangent[1:] ** 2) & (share < 3.0 * tangent[1:] ** 2))
    moved = np.abs(found[1:, 1]) / heights[1:]
    # outward along the ray, and nearer with all of it
    assert moved == pytest.approx(tangent[1:] * np.abs(tangent[1:] ** 2 - share), rel=0.1)


def test_shear_turns_about_the_wind_at_ten_metres() -> None:
    rng = np.random.default_rng(0)
    for shear in (0.0, 1.0, 2.5):
        wind = Wind(Weather(wind=4.0, wind_from=np.pi, turbulence="none", shear=shear), rng)
        for height in (0.5, 2.0, 10.0, 30.0):
            wanted = 4.0 + shear * (mean_speed(height, 4.0) - 4.0)
            assert wind.mean(height)[1] == pytest.approx(wanted)


def test_every_name_of_the_contract_is_there_and_tells_its_topic() -> None:
    assert set(TOLD) >= CONTRACT
    clocks = {cause.topic for cause in CATALOGUE.values() if cause.title == "clock_offset"}
    assert clocks == {"imu", "gps", "baro", "mag", "sonar", "pad"}


def test_a_rotor_that_droops_needs_the_throttle_that_its_load_takes() -> None:
    """Planted once: the tail rotor's torque left out."""
    sound = trim(Pipeline(RAPTOR.terms, RAPTOR.parameters, RAPTOR.geometry), RAPTOR.inertia)
    hover = float(RAPTOR.geometry["mass"]) * GRAVITY
    inflow = np.sqrt(hover / (2.0 * 1.225 * np.pi * float(RAPTOR.geometry["rotor_radius"]) ** 2))
    load = float(sound.signals["rotor_torque"] + sound.signals["tail_torque"])
    load /= hover * inflow / (0.4 * float(RAPTOR.geometry["nominal_speed"]))
    assert 0.7 < load < 1.3  # a figure of merit of 0.4 is about right
    for droop in (0.05, 0.15):
        terms = (*RAPTOR.terms, TERMS["rotor_droop"])
        numbers = {**RAPTOR.parameters, "rotor_droop": {"droop": droop}}
        odd = trim(Pipeline(terms, numbers, RAPTOR.geometry), RAPTOR.inertia)
        assert odd.controls.throttle == pytest.approx(sound.controls.throttle / (1.0 - droop * load), rel=1e-4)


def test_a_known_wind_blows_where_the_scenario_says_nothing() -> None:
    document = copy.deepcopy(dict(RAPTOR.document))
    for name, value, unit in (("wind_e", 3.0, "m/s"), ("wind_n", -4.0, "m/s"), ("wind_shear", 0.5, "1")):
        document["environment"][name] = {"value": value, "unit": unit}
    windy = vehicles.from_document(document, RAPTOR.path)
    air = expected_weather(Scenario(vehicle="raptor90"), windy)
    assert Wind(air, np.random.default_rng(0)).mean(10.0) == pytest.approx([3.0, -4.0, 0.0])
    assert air.shear == 0.5
    told = Scenario(vehicle="raptor90", weather=WeatherTable(wind_m_s=1.0))
    assert expected_weather(told, windy).wind == 1.0
