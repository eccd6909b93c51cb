"""The catalogue of causes by name, one a file; one of several alike (clocks, rotors) has its number behind a #."""

from collections.abc import Mapping
from importlib import import_module

from identification.causes.contract import Cause as Cause
from identification.causes.contract import Change as Change
from identification.causes.contract import Parameter as Parameter

NAMES: tuple[str, ...] = (
    "ground_effect", "thrust_scale", "mass", "fuel_burn", "cg_offset", "drag", "actuator_lag", "actuator_delay",
    "actuator_deadband", "vortex_ring", "tail_rotor_force", "flapping_lag", "baro_drift", "baro_downwash", "baro_lag",
    "gps_bias", "gps_drift", "gps_latency", "camera_latency", "sonar_scale", "imu_bias", "imu_scale",
    "imu_misalignment", "mag_bias", "camera_focal", "camera_tilt",
    "wind", "rotor_droop", "clock_offset", "lens_distortion", "baro_port", "baro_glitch",
    "sonar_false_echo",
)  # fmt: skip
# of other kinds of vehicle, each of which fits them to its own parts
ELSEWHERE: tuple[str, ...] = (
    "battery_sag", "rotor_damage", "joint_friction", "joint_stiffness", "input_nonlinearity",
)  # fmt: skip


def _of(name: str) -> tuple[Cause, ...]:
    module = import_module(f"{__name__}.{name}")
    alike: tuple[Cause, ...] = getattr(module, "ALL", ()) or (module.CAUSE,)
    return alike


CATALOGUE: Mapping[str, Cause] = {cause.name: cause for name in NAMES for cause in _of(name)}
# every name that a diagnosis may say, one of several alike for all of them
TOLD: Mapping[str, Cause] = {cause.title: cause for name in (*NAMES, *ELSEWHERE) for cause in _of(name)[:1]}
