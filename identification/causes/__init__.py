"""The catalogue of causes by name, one a file."""

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
    "baro_glitch", "sonar_false_echo",
)  # fmt: skip

CATALOGUE: Mapping[str, Cause] = {name: import_module(f"{__name__}.{name}").CAUSE for name in NAMES}
