"""What sensors are declared to be off by, as prior, noise and memory of the motion filter's error states."""

import math

import numpy as np
from numpy.typing import NDArray

from flightlog.constants import GRAVITY
from identification import kinematics as k
from sim.vehicle import Vehicle
from sim.world import MAGNETIC_FIELD

Floats = NDArray[np.float64]

LASTING = 30.0  # [s] over which a slow error of the attitude is taken for a constant one
PAD_TAU = 6.0  # [s] for which a front end's errors last: attitude that it was given, size of the mark


def statistics(vehicle: Vehicle, node_step: float, imu_step: float) -> tuple[Floats, Floats, Floats]:
    """Variance at the start, variance added a node, and factor a node, of each error state, as declared."""
    prior, noise, decay = np.zeros(k.STATES), np.zeros(k.STATES), np.ones(k.STATES)
    numbers = {topic: fitted.numbers for topic, fitted in vehicle.sensors.items()}

    def wander(at: slice, std: float, tau: float) -> None:
        decay[at] = math.exp(-node_step / tau)
        noise[at] = std**2 * (1.0 - decay[at] ** 2)

    imu = numbers["imu"]
    prior[k.P : k.P + 3], prior[k.V : k.V + 3] = 4.0, 1.0
    if "gps" in numbers:  # its first fix is the start
        prior[k.P : k.P + 3], prior[k.V : k.V + 3] = 1.0, 9.0 * numbers["gps"]["velocity_noise"] ** 2
    prior[k.PHI : k.PHI + 2], prior[k.PHI + 2] = 0.02**2, 0.05**2
    prior[k.CASE : k.CASE + 3] = imu["misalignment_std"] ** 2
    prior[k.RATE_SCALE : k.RATE_SCALE + 3] = imu["gyro_scale_std"] ** 2
    prior[k.B_A : k.B_A + 3] = imu["accel_bias_std"] ** 2 + (imu["accel_scale_std"] * GRAVITY) ** 2
    prior[k.B_G : k.B_G + 3] = imu["gyro_bias_std"] ** 2
    noise[k.B_A : k.B_A + 3] = 2 * imu["accel_drift_std"] ** 2 * node_step / imu["accel_drift_tau"]
    noise[k.B_G : k.B_G + 3] = 2 * imu["gyro_drift_std"] ** 2 * node_step / imu["gyro_drift_tau"]
    # white noise of force and rate; the vibration's share is what a sampled turn leaves of it
    shaken = 0.5 * (imu["vibration_force_1"] ** 2 + imu["vibration_force_2"] ** 2) * imu_step * 0.02
    noise[k.V : k.V + 3] = 0.5 * imu["accel_noise"] ** 2 * node_step + shaken * node_step
    noise[k.PHI : k.PHI + 3] = 0.5 * imu["gyro_noise"] ** 2 * node_step + 1e-9 * node_step
    if "baro" in numbers:
        n = numbers["baro"]
        prior[k.BARO_BIAS] = n["bias_std"] ** 2
        wander(slice(k.BARO_DRIFT, k.BARO_DRIFT + 1), n["drift_std"], n["drift_tau"])
    if "gps" in numbers:
        n = numbers["gps"]
        up = [n["bias_std"], n["bias_std"], n["bias_std_up"]]
        prior[k.GPS_BIAS : k.GPS_BIAS + 3] = np.square(up)
        for axis, std in enumerate((n["wander_std"], n["wander_std"], n["wander_std_up"])):
            at = slice(k.GPS_WANDER + axis, k.GPS_WANDER + axis + 1)
            wander(at, std, n["wander_tau"])
            prior[at] = std**2
    if "mag" in numbers:
        n = numbers["mag"]
        turned = n["misalignment_std"] * float(np.linalg.norm(MAGNETIC_FIELD))
        prior[k.MAG : k.MAG + 3] = n["bias_std"] ** 2 + n["drift_std"] ** 2 + turned**2
        noise[k.MAG : k.MAG + 3] = 2 * n["drift_std"] ** 2 * node_step / n["drift_tau"]
    if "sonar" in numbers:
        prior[k.SONAR_SCALE] = numbers["sonar"]["scale_std"] ** 2
    if "pad" in numbers:
        wander(slice(k.PAD_SLOW, k.PAD_SLOW + 4), 1.0, PAD_TAU)
        prior[k.PAD_SLOW : k.PAD_SLOW + 4] = 1.0
        prior[k.CAMERA_SCALE] = numbers["pad"]["scale_std"] ** 2
        # of the body that the sensor sees, and what of the attitude's error outlasts a minute
        lasting = 2.0 * numbers["pad"]["tilt_tau"] / LASTING * numbers["pad"]["tilt_std"] ** 2
        prior[k.CAMERA_TILT : k.CAMERA_TILT + 2] = imu["misalignment_std"] ** 2 + 2.0 * lasting
    return prior, noise, decay
