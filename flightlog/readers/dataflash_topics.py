"""ArduPilot's messages as our topics: NED to ENU, FRD to FLU, the units of each firmware to SI.

A message is taken for what its columns are, since names and columns changed from version to version. Sources: the
project's documentation of log messages, and what the firmware writes (AP_Logger, LogStructure.h).
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightlog.geodesy import LocalFrame
from flightlog.readers.dataflash import parse
from flightlog.readers.dataflash_source import Source, is_whole
from flightlog.readers.log import Draft, Log

Floats = NDArray[np.float64]

GROUND = 3.0  # [s] of the first fixes, whose median is the origin
FIX_3D = 3
DOWNWARD = 25  # orientation of a rangefinder
MOTORS = {**{33 + k: k + 1 for k in range(8)}, **{82 + k: k + 9 for k in range(4)}}  # SERVOn_FUNCTION -> motor


def read_dataflash(path: Path) -> Log:
    """The log as topics; UserError where nothing in it is a measurement."""
    messages, notes = parse(path)
    draft = Draft(path, "dataflash")
    for note in notes:
        draft.note(note)
    source = Source(messages, draft)
    for translate in _TRANSLATORS:
        translate(source)
    return draft.finish({"parameters": source.parameters})


def _imu(source: Source) -> None:
    axes = ("AccX", "AccY", "AccZ", "GyrX", "GyrY", "GyrZ")
    for m in source.instances("IMU", *axes):
        fx, fy, fz, wx, wy, wz = (m[axis] for axis in axes)
        source.add("imu", m, {"fx": fx, "fy": -fy, "fz": -fz, "wx": wx, "wy": -wy, "wz": -wz})


def _mag(source: Source) -> None:
    """Milligauss, offsets taken off already."""
    for m in source.instances("MAG", "MagX", "MagY", "MagZ"):
        source.add("mag", m, {"mx": 0.1 * m["MagX"], "my": -0.1 * m["MagY"], "mz": -0.1 * m["MagZ"]})


def _baro(source: Source) -> None:
    """The firmware's own height above where it was armed; by CTUN where there is no BARO."""
    found = source.instances("BARO", "Alt")
    found += source.instances("BAR", "Alt") if not found else [m for m in (source.get("BAR2", "Alt"),
                                                                           source.get("BAR3", "Alt")) if m]  # fmt: skip
    for m in found:
        columns = {"altitude": m["Alt"]}
        if "Press" in m:
            columns["pressure"] = m["Press"]
        if "Temp" in m:
            columns["temperature"] = m["Temp"] + 273.15
        source.add("baro", m, columns)
    tuning = source.get("CTUN")
    if not found and tuning is not None and (column := tuning.first("BarAlt", "BAlt")):
        source.add("baro", tuning, {"altitude": tuning[column]})


def _gps(source: Source) -> None:
    """Place from the first fixes; height is the column Alt less their median, velocity from speed and course."""
    frame: LocalFrame | None = None
    for m in source.instances("GPS", "Lat", "Lng", "Alt", "Status"):
        valid = m["Status"] >= (FIX_3D if np.nanmax(m["Status"]) >= FIX_3D else FIX_3D - 1)
        valid &= np.isfinite(m["Lat"] + m["Lng"] + m["Alt"]) & ((m["Lat"] != 0.0) | (m["Lng"] != 0.0))
        t, _ = source.time(m)
        if frame is None and valid.any():
            first = valid & (t <= t[valid][0] + GROUND) & (t >= t[valid][0])
            frame = LocalFrame(*(float(np.median(m[name][first])) for name in ("Lat", "Lng", "Alt")))
        if frame is None:
            source.draft.note(f"{m.name}: no fix in the whole log; left out")
            continue
        e, n, u = frame.enu(m["Lat"], m["Lng"], m["Alt"])
        columns: dict[str, Any] = {"e": e, "n": n, "u": u, "valid": valid}
        if "Spd" in m and "GCrs" in m:
            course = np.radians(m["GCrs"])
            columns |= {"ve": m["Spd"] * np.sin(course), "vn": m["Spd"] * np.cos(course)}
        if "VZ" in m:
            columns["vu"] = -m["VZ"]
        if (satellites := m.first("NSats")) is not None:
            columns["satellites"] = m[satellites]
        if "HDop" in m:
            columns["hdop"] = m["HDop"]
        far = {"latitude": m["Lat"], "longitude": m["Lng"], "height": m["Alt"]}
        source.add("gps", m, columns | far, units={"latitude": "deg", "longitude": "deg", "height": "m"})
    if frame is not None:
        place = f"{frame.latitude:.7f}, {frame.longitude:.7f}, {frame.altitude:.2f} m"
        source.draft.note(f"gps: the origin is the median of the first {GROUND:g} s of fixes, {place}")


def _sonar(source: Source) -> None:
    """A rangefinder that looks down; by CTUN where there is no RFND."""
    found = False
    for m in source.instances("RFND"):
        distance = m.first("Dist", "Dist1")
        if distance is None or ("Orient" in m and not np.any(m["Orient"] == DOWNWARD)):
            continue
        down = m.only(m["Orient"] == DOWNWARD) if "Orient" in m else m
        valid = down["Stat"] == 4 if "Stat" in down else down[distance] > 0.0
        source.add("sonar", down, {"range": down[distance], "valid": valid})
        found = True
    tuning = source.get("CTUN")
    column = tuning.first("SonAlt", "SAlt") if tuning is not None and not found else None
    if tuning is None or column is None:
        return
    heard = np.isfinite(tuning[column]) & (tuning[column] > 0.0)
    if heard.any():
        source.add("sonar", tuning, {"range": tuning[column], "valid": heard})
    else:
        source.draft.note(f"CTUN.{column} is nothing but zero: no sonar")


def _controls(source: Source) -> None:
    """What the attitude loops' outcome leaves for lift: a helicopter's collective, another's throttle, in 0 .. 1."""
    m = source.get("CTUN")
    if m is not None and (column := m.first("ThrOut", "ThO")):
        share = m[column] / (1000.0 if is_whole(m, column) else 1.0)
        columns = {"throttle" if source.copter else "collective": share}
        if (stick := m.first("ThrIn", "ThI")) is not None:
            columns["throttle_stick"] = m[stick] / (1000.0 if is_whole(m, stick) else 1.0)
        source.add("controls", m, columns, units={"throttle_stick": "1", "collective": "1"})


def _motors(source: Source) -> None:
    """Pulses to the motors, as a share of what the parameters call their range."""
    if not source.copter:
        return
    parameters = source.parameters
    low = parameters.get("MOT_PWM_MIN") or parameters.get("RC3_MIN") or 1000.0
    high = parameters.get("MOT_PWM_MAX") or parameters.get("RC3_MAX") or 2000.0
    channels = {
        int(found[1]): MOTORS[int(value)] for key, value in parameters.items()
        if value in MOTORS and (found := re.fullmatch(r"SERVO(\d+)_FUNCTION", key))
    }  # fmt: skip
    m = source.get("RCOU")
    if m is not None:
        names = {f"C{channel}": motor for channel, motor in sorted(channels.items(), key=lambda item: item[1])}
        if not names:
            names = {f"Chan{k}": k for k in range(1, 9)} | {f"Ch{k}": k for k in range(1, 9)}
    else:
        m = source.get("MOT")
        names = {f"Mot{k}": k for k in range(1, 13)}
    if m is None or high <= low:
        return
    columns = {}
    for name, motor in names.items():
        if name in m and np.nanmax(m[name], initial=0.0) > low:
            columns[f"m{motor}"] = np.clip((m[name] - low) / (high - low), 0.0, None)
    if columns:
        source.add("actuators", m, columns)


def _rotor(source: Source) -> None:
    """Rotor speeds: of a tachometer, else of the motors' own telemetry at the first one's times."""
    m = source.get("RPM")
    if m is not None and (column := m.first("rpm1", "RPM1", "RPM")):
        source.add("rotor", m, {"speed": m[column] * (2.0 * np.pi / 60.0)})
        return
    found = [m for m in source.instances("ESC", "RPM") if np.nanmax(m["RPM"], initial=0.0) > 0.0]
    if not found:
        return
    t, _ = source.time(found[0])
    columns = {}
    for number, m in enumerate(found, 1):
        own, _ = source.time(m)
        columns[f"speed{number}"] = np.interp(t, own, m["RPM"]) * (2.0 * np.pi / 60.0)
    source.add("rotor", found[0], columns)


def _battery(source: Source) -> None:
    """Volt and ampere; the oldest firmware wrote whole hundredths."""
    found = source.instances("BAT", "Volt") or source.instances("CURR", "Volt")
    for m in found:
        scale = 0.01 if is_whole(m, "Volt") else 1.0
        columns = {"voltage": scale * m["Volt"]}
        if "Curr" in m:
            columns["current"] = m["Curr"] * (0.01 if is_whole(m, "Curr") else 1.0)
        source.add("battery", m, columns)


def _flow(source: Source) -> None:
    """Rates [rad/s] about body x and y, positive where the vehicle turns so over still ground."""
    m = source.get("OF", "flowX", "flowY", "Qual")
    if m is None:
        return
    t, _ = source.time(m)
    dt = np.diff(t, prepend=np.nan)
    source.add("flow", m, {"dt": dt, "u": m["flowX"] * dt, "v": m["flowY"] * dt, "quality": m["Qual"] / 255.0})


def _estimate(source: Source) -> None:
    """The vehicle's own attitude, and beside it the state of its first Kalman filter."""
    m = source.get("ATT", "Roll", "Pitch", "Yaw")
    if m is not None:
        roll, pitch, yaw = (np.radians(m[axis]) for axis in ("Roll", "Pitch", "Yaw"))
        source.add("estimate", m, {"roll": roll, "pitch": pitch, "heading": yaw % (2.0 * np.pi)})
    for name in ("XKF1", "NKF1", "EKF1"):
        m = source.get(name, "Roll", "Pitch", "Yaw", "VN", "VE", "VD", "PN", "PE", "PD")
        if m is None:
            continue
        m = m.only(m["C"] == np.min(m["C"])) if "C" in m else m
        roll, pitch, yaw = (np.radians(m[axis]) for axis in ("Roll", "Pitch", "Yaw"))
        columns = {"e": m["PE"], "n": m["PN"], "u": -m["PD"], "ve": m["VE"], "vn": m["VN"], "vu": -m["VD"]}
        source.add("estimate", m, columns | {"roll": roll, "pitch": pitch, "heading": yaw % (2.0 * np.pi)})
        break


_TRANSLATORS: tuple[Callable[[Source], None], ...] = (
    _imu, _mag, _baro, _gps, _sonar, _controls, _motors, _rotor, _battery, _flow, _estimate
)  # fmt: skip
