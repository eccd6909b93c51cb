"""The sensors behind a log of unknown make: rates and noise levels as the log shows them, the rest nominal."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from flightlog.equipment import Equipment
from flightlog.tables import Table

Floats = NDArray[np.float64]

NO_NOTCH = 1e6  # [rad/s] a rotor whose vibration no inertial sensor shows: the notches let all through
STEADY = 0.03  # share of echoes at the largest range beyond which that is the ranger's way to say nothing
FIRST = 1.0  # [s] of force and field from which the Earth's field is taken

# a receiver and a barometer of the usual kind, where the log does not show them to be worse
GPS_WANDER, GPS_BIAS, BARO_DRIFT = 1.0, 1.0, 0.7  # [m]
GPS_NOISE, BARO_NOISE = 0.3, 0.2  # [m]
SLOW = 10.0  # [s] what changes in less is noise


def fit(tables: Mapping[str, Table], nominal: Equipment, *, declination: float = 0.0) -> Equipment:
    """The equipment of a log.

    Args:
        tables: the log's, by topic.
        nominal: whose numbers stand in for what a log cannot show; mounts and latencies are taken for none.
        declination: [rad] of the magnetic field, east positive.
    """
    sensors = {}
    for topic, spec in nominal.sensors.items():
        if topic in tables:
            sensors[topic] = replace(
                spec, rate=_rate(tables[topic], spec.rate), latency=0.0, position=np.zeros(3),
                numbers={**spec.numbers, **_numbers(topic, tables)},
            )  # fmt: skip
    if "imu" in sensors and "rotor" not in sensors and "rotor" in nominal.sensors:
        sensors["rotor"] = nominal.sensors["rotor"]  # none: the notches are open
    return replace(
        nominal, sensors=sensors, cameras={}, mark=None, nominal_rotor_speed=NO_NOTCH,
        magnetic_field=_field(tables, nominal.magnetic_field, declination),
    )  # fmt: skip


def white(values: Floats) -> float:
    """Standard deviation of the white part of a series (N,), robustly, from its second differences; 0.0 for none."""
    values = values[np.isfinite(values)]
    if len(values) < 8:
        return 0.0
    bends = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(bends - np.median(bends))) / math.sqrt(6.0))


def _rate(table: Table, otherwise: float) -> float:
    steps = np.diff(table["t"])
    steps = steps[steps > 0.0]
    return float(1.0 / np.median(steps)) if len(steps) else otherwise


def _numbers(topic: str, tables: Mapping[str, Table]) -> dict[str, float]:
    """What the log shows of one sensor, by the names of the vehicle file."""
    table = tables[topic]
    if topic == "imu":
        period = 1.0 / _rate(table, 250.0)
        force = max(white(table[axis]) for axis in ("fx", "fy", "fz"))
        rate = max(white(table[axis]) for axis in ("wx", "wy", "wz"))
        # MEMS of unknown calibration; densities, so that vibration counts as the noise that it is
        return {
            "accel_noise": max(0.01, force * math.sqrt(period)), "accel_bias_std": 0.2,
            "gyro_noise": max(1e-3, rate * math.sqrt(period)), "gyro_bias_std": 0.01,
        }  # fmt: skip
    if topic == "baro":
        slow, fast = _disagreement(tables)
        drift = max(BARO_DRIFT, slow)
        noise = max(BARO_NOISE, white(table["altitude"]), fast)
        return {"noise": noise, "lag": 0.0, "bias_std": drift, "drift_std": drift}
    if topic == "gps":
        found = {"latency": 0.0, "bias_std": GPS_BIAS, "wander_std": GPS_WANDER}
        slow, fast = _disagreement(tables)
        found["noise"] = max(GPS_NOISE, white(table["e"]), white(table["n"]))
        found["noise_up"] = max(GPS_NOISE, white(table["u"]), fast)
        wander = max(GPS_WANDER, slow)
        found |= {"bias_std_up": wander, "wander_std_up": wander}
        found["velocity_noise"] = max([0.1, *(white(table[axis]) for axis in ("ve", "vn", "vu"))])
        dilution = table["hdop"][np.isfinite(table["hdop"])]
        found["hdop"] = float(np.median(dilution)) if len(dilution) and np.median(dilution) > 0.0 else 1.0
        return found
    if topic == "sonar":
        return {**_reach(table), "noise_share": 0.01, "scale_std": 0.02, "resolution": 0.03}
    return {}


def _disagreement(tables: Mapping[str, Table]) -> tuple[float, float]:
    """Robust standard deviation [m] of each of barometer and GPS from what they disagree by, slowly and fast.

    Neither is known to be the better, so each is given half of the variance. What white noise does not show, a
    receiver's smoothing or gusts over a port, stands in the fast part.
    """
    if "baro" not in tables or "gps" not in tables:
        return 0.0, 0.0
    baro, gps = tables["baro"], tables["gps"]
    sound = np.isfinite(gps["u"]) & (gps["valid"].astype(float) != 0.0)
    altitude, own = baro["altitude"], baro["t"]
    heard = np.isfinite(altitude)
    if sound.sum() < 8 or heard.sum() < 8:
        return 0.0, 0.0
    apart = np.interp(gps["t"][sound], own[heard], altitude[heard]) - gps["u"][sound]
    window = 2 * max(1, round(0.5 * SLOW * _rate(gps, 5.0))) + 1
    slow = median_filter(apart, size=window, mode="nearest")
    share = 1.4826 / math.sqrt(2.0)
    return (
        share * float(np.median(np.abs(slow - np.median(slow)))),
        share * float(np.median(np.abs(apart - slow))),
    )


def _reach(table: Table) -> dict[str, float]:
    """Up to where a ranger measures: many like the largest echo say that there was none."""
    ranges = table["range"][np.isfinite(table["range"]) & (table["valid"].astype(float) != 0.0)]
    if not len(ranges):
        return {}
    most = float(ranges.max())
    stands = np.count_nonzero(ranges > 0.99 * most) > STEADY * len(ranges)
    return {"greatest_range": 0.98 * most if stands else most}


def _field(tables: Mapping[str, Table], nominal: Floats, declination: float) -> Floats:
    """The Earth's field (3,) [uT] ENU: its size and dip against the force at the log's beginning."""
    if "mag" not in tables or "imu" not in tables:
        return nominal
    means = []
    for topic, axes in (("mag", ("mx", "my", "mz")), ("imu", ("fx", "fy", "fz"))):
        table = tables[topic]
        rows = table.stack(*axes)[table["t"] <= table["t"][0] + FIRST]
        rows = rows[np.isfinite(rows).all(axis=1)]
        if not len(rows):
            return nominal
        means.append(rows.mean(axis=0))
    field, force = means
    size, length = float(np.linalg.norm(field)), float(np.linalg.norm(force))
    if size < 1.0 or length < 1.0:
        return nominal
    up = float(field @ force) / length
    level = math.sqrt(max(0.0, size**2 - up**2))
    if level < 1.0:
        return nominal
    return np.array([level * math.sin(declination), level * math.cos(declination), up])

