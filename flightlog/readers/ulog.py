"""PX4 ULog by pyulog, its messages as our topics: NED to ENU, FRD to FLU, microseconds to seconds.

Field names are those of the firmware's message files from version 1.8 on; where they changed, both are known.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from flightlog.geodesy import LocalFrame
from flightlog.readers.log import Draft, Log
from flightlog.readers.ulog_file import Dataset, Source
from flightlog.rotations import to_angles

Floats = NDArray[np.float64]

DOWNWARD = 25  # orientation of a distance sensor
FIX_3D = 3
GROUND = 3.0  # [s] of the first fixes, whose median is the origin where the estimate has none
NEAR = 0.1  # [s] an attitude this far from a position is not put beside it
_ENU = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_FLU = Rotation.from_quat([1.0, 0.0, 0.0, 0.0])


def read_ulog(path: Path) -> Log:
    """The log as topics; UserError where it cannot be read or nothing in it is a measurement."""
    draft = Draft(path, "ulog")
    source = Source(path, draft)
    for translate in _TRANSLATORS:
        translate(source)
    return draft.finish({"parameters": source.parameters})


def _imu(source: Source) -> None:
    for m in source.all("sensor_combined"):
        force, rate = m.vector("accelerometer_m_s2"), m.vector("gyro_rad")
        if force is None or rate is None:
            continue
        (fx, fy, fz), (wx, wy, wz) = force, rate
        source.draft.add("imu", {"t": m.t, "fx": fx, "fy": -fy, "fz": -fz, "wx": wx, "wy": -wy, "wz": -wz})


def _mag(source: Source) -> None:
    """Gauss."""
    for m in source.all("vehicle_magnetometer", "sensor_mag"):
        field = m.vector("magnetometer_ga") or ([m[a] for a in "xyz"] if all(a in m for a in "xyz") else None)
        if field is not None:
            x, y, z = field
            source.draft.add("mag", {"t": m.valid_time, "mx": 100.0 * x, "my": -100.0 * y, "mz": -100.0 * z})


def _baro(source: Source) -> None:
    """Height is above the sea, or by another datum: zero at the first sample."""
    for m in source.all("vehicle_air_data", "sensor_baro"):
        columns = {"t": m.valid_time}
        altitude = m.first("baro_alt_meter", "altitude")
        if altitude is not None and np.isfinite(altitude).any():
            columns["altitude"] = altitude - altitude[np.isfinite(altitude)][0]
        if (pressure := m.first("baro_pressure_pa")) is not None:
            columns["pressure"] = pressure
        elif (pressure := m.first("pressure")) is not None:
            columns["pressure"] = pressure * (100.0 if np.nanmedian(pressure) < 2000.0 else 1.0)
        celsius = m.first("baro_temp_celcius", "baro_temp_celsius", "ambient_temperature", "temperature")
        if celsius is not None:
            columns["temperature"] = celsius + 273.15
        source.draft.add("baro", columns)


def _gps(source: Source) -> None:
    frame = _reference(source)
    for m in source.all("vehicle_gps_position", "sensor_gps"):
        if "latitude_deg" in m and "longitude_deg" in m:
            latitude, longitude = m["latitude_deg"], m["longitude_deg"]
            height = m.first("altitude_msl_m", "altitude_ellipsoid_m")
        elif "lat" in m and "lon" in m and "alt" in m:
            latitude, longitude, height = m["lat"] * 1e-7, m["lon"] * 1e-7, m["alt"] * 1e-3
        else:
            continue
        if height is None:
            continue
        valid = np.isfinite(latitude + longitude + height)
        valid &= m["fix_type"] >= FIX_3D if "fix_type" in m else True
        t = m.valid_time
        if frame is None and valid.any():
            first = valid & (t <= t[valid][0] + GROUND) & (t >= t[valid][0])
            frame = LocalFrame(*(float(np.median(values[first])) for values in (latitude, longitude, height)))
        if frame is None:
            source.draft.note("vehicle_gps_position: no fix in the whole log; left out")
            continue
        e, n, u = frame.enu(latitude, longitude, height)
        columns = {"t": t, "t_arrival": m.t, "e": e, "n": n, "u": u, "valid": valid}
        if all(name in m for name in ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")):
            columns |= {"ve": m["vel_e_m_s"], "vn": m["vel_n_m_s"], "vu": -m["vel_d_m_s"]}
        for name, other in (("satellites_used", "satellites"), ("hdop", "hdop")):
            if name in m:
                columns[other] = m[name]
        far = {"latitude": latitude, "longitude": longitude, "height": height}
        source.draft.add("gps", columns | far, units={"latitude": "deg", "longitude": "deg", "height": "m"})
    if frame is not None and source.all("vehicle_gps_position", "sensor_gps"):
        place = f"{frame.latitude:.7f}, {frame.longitude:.7f}, {frame.altitude:.2f} m"
        source.draft.note(f"gps: the origin is {place}")


def _reference(source: Source) -> LocalFrame | None:
    """The origin of the vehicle's own estimate, where it has one."""
    m = source.one("vehicle_local_position")
    if m is None or not all(name in m for name in ("ref_lat", "ref_lon", "ref_alt")):
        return None
    known = np.isfinite(m["ref_lat"] + m["ref_lon"] + m["ref_alt"]) & ((m["ref_lat"] != 0.0) | (m["ref_lon"] != 0.0))
    for flag in ("xy_global", "z_global"):
        known &= m[flag] > 0.0 if flag in m else True
    if not known.any():
        return None
    last = np.flatnonzero(known)[-1]
    latitude, longitude, altitude = (float(m[name][last]) for name in ("ref_lat", "ref_lon", "ref_alt"))
    return LocalFrame(latitude, longitude, altitude)


def _sonar(source: Source) -> None:
    for m in source.all("distance_sensor"):
        if "current_distance" not in m or ("orientation" in m and not np.any(m["orientation"] == DOWNWARD)):
            continue
        distance = m["current_distance"]
        valid = np.isfinite(distance)
        if "min_distance" in m and "max_distance" in m:
            valid &= (distance >= m["min_distance"]) & (distance <= m["max_distance"])
        if "signal_quality" in m:
            valid &= m["signal_quality"] != 0.0
        if "orientation" in m:
            valid &= m["orientation"] == DOWNWARD
        source.draft.add("sonar", {"t": m.valid_time, "range": distance, "valid": valid})


def _flow(source: Source) -> None:
    """Angles about body x and y, positive where the vehicle turns so over still ground."""
    for m in source.all("vehicle_optical_flow", "sensor_optical_flow", "optical_flow"):
        angles = m.vector("pixel_flow", 2)
        if angles is None and "pixel_flow_x_integral" in m and "pixel_flow_y_integral" in m:
            angles = [m["pixel_flow_x_integral"], m["pixel_flow_y_integral"]]
        span = m.first("integration_timespan_us", "integration_timespan")
        if angles is None or span is None:
            continue
        columns = {"t": m.valid_time, "t_arrival": m.t, "dt": span * 1e-6, "u": angles[0], "v": angles[1]}
        if "quality" in m:
            columns["quality"] = m["quality"] / 255.0
        source.draft.add("flow", columns)


def _controls(source: Source) -> None:
    """Motor commands 0 .. 1, else the pulses of the outputs."""
    m = source.one("actuator_motors")
    if m is not None:
        columns = {f"m{i + 1}": m[f"control[{i}]"] for i in range(12) if f"control[{i}]" in m}
        source.draft.add("controls", {"t": m.valid_time, **columns})
        return
    m = source.one("actuator_outputs")
    if m is None:
        return
    used = int(np.nanmax(m["noutputs"], initial=0.0)) if "noutputs" in m else 16
    columns = {}
    for i in range(min(used, 16)):
        values = m.first(f"output[{i}]")
        if values is None or not np.nanmax(np.abs(values), initial=0.0) > 0.0:
            continue
        columns[f"m{i + 1}"] = np.clip((values - 1000.0) / 1000.0, 0.0, None) if np.nanmax(values) > 2.0 else values
    if columns:
        source.draft.add("controls", {"t": m.t, **columns})


def _rotor(source: Source) -> None:
    m = source.one("esc_status")
    if m is None:
        return
    count = int(np.nanmax(m["esc_count"], initial=0.0)) if "esc_count" in m else 8
    turns = 2.0 * np.pi / 60.0
    speeds = [m[f"esc[{i}].esc_rpm"] * turns for i in range(min(count, 8)) if f"esc[{i}].esc_rpm" in m]
    names = ["speed"] if len(speeds) == 1 else [f"speed{i + 1}" for i in range(len(speeds))]
    source.draft.add("rotor", {"t": m.t, **dict(zip(names, speeds, strict=True))})


def _battery(source: Source) -> None:
    for m in source.all("battery_status"):
        columns = {"t": m.t}
        if (voltage := m.first("voltage_v", "voltage_filtered_v")) is not None:
            columns["voltage"] = voltage
        if (current := m.first("current_a", "current_filtered_a")) is not None:
            columns["current"] = current
        source.draft.add("battery", columns)


def _estimate(source: Source) -> None:
    """Position and velocity with the attitude of that time beside them; else the attitude alone."""
    place, turn = source.one("vehicle_local_position"), source.one("vehicle_attitude")
    angles = _angles(turn) if turn is not None else None
    if place is None:
        if angles is not None:
            t, roll, pitch, heading = angles
            source.draft.add("estimate", {"t": t, "roll": roll, "pitch": pitch, "heading": heading})
        return
    t = place.valid_time
    columns = {"t": t}
    for name, column, sign in (
        ("y", "e", 1.0), ("x", "n", 1.0), ("z", "u", -1.0), ("vy", "ve", 1.0), ("vx", "vn", 1.0), ("vz", "vu", -1.0),
        ("ay", "ae", 1.0), ("ax", "an", 1.0), ("az", "au", -1.0),
    ):  # fmt: skip
        if name in place:
            columns[column] = sign * place[name]
    if angles is not None:
        stamps, roll, pitch, heading = angles
        nearest = np.abs(t - stamps[np.clip(np.searchsorted(stamps, t), 1, len(stamps) - 1) - 1])
        nearest = np.minimum(nearest, np.abs(t - stamps[np.clip(np.searchsorted(stamps, t), 0, len(stamps) - 1)]))
        for name, values in (("roll", roll), ("pitch", pitch), ("heading", heading)):
            between = np.interp(t, stamps, np.unwrap(values))
            between = between % (2.0 * np.pi) if name == "heading" else between
            columns[name] = np.where(nearest <= NEAR, between, np.nan)
    source.draft.add("estimate", columns)


def _angles(m: Dataset) -> tuple[Floats, Floats, Floats, Floats] | None:
    """(t [s], roll, pitch, heading [rad]) from the quaternion, FRD to NED; in order of time."""
    q = m.vector("q", 4)
    if q is None:
        return None
    wxyz = np.column_stack(q)
    sound = np.isfinite(wxyz).all(axis=1) & (np.linalg.norm(wxyz, axis=1) > 1e-3)
    if not sound.any():
        return None
    turned = _ENU * Rotation.from_quat(wxyz[sound][:, [1, 2, 3, 0]]) * _FLU
    order = np.argsort(m.valid_time[sound], kind="stable")
    roll, pitch, heading = to_angles(turned)
    return m.valid_time[sound][order], roll[order], pitch[order], heading[order]


_TRANSLATORS: tuple[Callable[[Source], None], ...] = (
    _imu, _mag, _baro, _gps, _sonar, _flow, _controls, _rotor, _battery, _estimate
)  # fmt: skip
