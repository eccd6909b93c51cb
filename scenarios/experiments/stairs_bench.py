"""The stairs of Lei 2012, figure 6: a camera, a barometer and a GPS receiver that stand still beside a light well."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimators.vision.h_mark import HMarkFrontEnd
from estimators.vision.lei_mark import LeiFrontEnd
from estimators.vision.sighting import PadPrediction, PadSighting
from flightlog.atmosphere import SURFACE_PRESSURE, SURFACE_TEMPERATURE, pressure_at, temperature_at
from flightlog.constants import GRAVITY
from flightlog.marks import HMark
from flightlog.rotations import angles, matrix, quaternion
from scenarios.experiments.lei_readings import heights
from scenarios.experiments.still_camera import CAMERA, MOUNT, Stand, edge_noise, height_bound, stand, still_camera
from sim import vehicle
from sim.cameras.exposure import Exposure
from sim.cameras.imaging import Imaging
from sim.cameras.noise import Noise
from sim.sensors.barometer import Barometer
from sim.sensors.contract import Truth
from sim.sensors.gps import Gps
from sim.sensors.noise import gauss_markov

Floats = NDArray[np.float64]

HEIGHTS = (5.12, 9.32, 13.52, 17.72)  # [m] by tape, table 1
RATE = 2.5  # [Hz] pictures
MARK = HMark()
LIGHT_WELL = Imaging(colour=False, exposure=Exposure(gain=1.7), noise=Noise(read=2.0, shot=3.5))
TILT_STD, TILT_TAU = math.radians(0.3), 20.0  # [rad, s] error of the inertial unit's roll and pitch
SWAY_STD, SWAY_TAU = math.radians(0.2), 1.0  # [rad, s] of whoever holds the rig out over the railing
DRIFT_STD = 0.02  # [m] the same, sideways
EXACT = math.radians(0.01)  # [rad] tilt error that our front end allows for where there is none
GPS_RATE, BARO_RATE, INERTIAL_RATE = 5.0, 10.0, 50.0  # [Hz]

# so that mean, deviation and largest error are the paper's: a steady offset by reflections from the walls, and once,
# on the lowest landing, a satellite that comes and goes behind them
GPS = {"bias_std": 0.0, "bias_std_up": 0.0, "bias_u": 0.745, "wander_std_up": 0.13, "wander_tau": 25.0, "latency": 0.0}
BURST, BURST_FROM, BURST_TO = 0.90, 5.0, 7.0  # [m, s]
BARO = {"bias_std": 0.0, "bias": 0.150, "drift_std": 0.07, "drift_tau": 40.0, "noise": 0.085, "downwash_gain": 0.0}


@dataclass(frozen=True, eq=False)
class Minute:
    """What was measured on one landing; errors are measured minus true heights [m]."""

    height: float  # [m]
    t_gps: Floats  # (G,)
    gps: Floats  # (G,) heights
    t_baro: Floats  # (B,)
    baro: Floats  # (B,)
    t: Floats  # (N,) of the pictures
    published: Floats  # (N, readings) heights, attitude with its error; NaN where the mark is not found
    ours: Floats  # (N,) attitude with its error
    ours_variance: Floats  # (N,)
    exact: Floats  # (N,) attitude known
    exact_variance: Floats  # (N,)
    bound: float  # [m] Cramer-Rao, one picture, attitude known
    picture: NDArray[np.uint8]  # the last


def minute(landing: int, seconds: float) -> Minute:
    """One landing of the stairs for so many seconds."""
    height = HEIGHTS[landing]
    rng = np.random.default_rng([20120436, landing])
    t_gps, gps, t_baro, baro = _instruments(height, landing, seconds, rng)
    times = np.arange(0.0, seconds, 1.0 / RATE)
    setup = stand(rng, height, tilt=math.radians(2.0), stray=0.02, turn=math.pi)
    published = LeiFrontEnd(CAMERA, MOUNT, MARK)
    ours = HMarkFrontEnd(CAMERA, MOUNT, MARK, tilt_std=TILT_STD)
    exact = HMarkFrontEnd(CAMERA, MOUNT, MARK, tilt_std=EXACT)
    error, sway, drift = TILT_STD * rng.standard_normal(2), np.zeros(2), np.zeros(2)
    rows: list[tuple[Any, ...]] = []
    with still_camera(MARK, "courtyard", LIGHT_WELL, seed=landing) as camera:
        for index, t in enumerate(times):
            error = _walk(error, TILT_STD, TILT_TAU, 1.0 / RATE, rng)
            sway = _walk(sway, SWAY_STD, SWAY_TAU, 1.0 / RATE, rng)
            drift = _walk(drift, DRIFT_STD, SWAY_TAU, 1.0 / RATE, rng)
            where = Stand(setup.position + np.append(drift, 0.0), _tilted(setup.attitude, sway))
            believed = _tilted(where.attitude, error)
            image = camera.picture(where, index)
            # where the published front end is told to look: below the camera, as far as the receiver says
            expected = float(gps[np.searchsorted(t_gps, t, side="right") - 1])
            sideways = 0.05 * expected
            region = PadPrediction(np.array([0.0, 0.0, expected]), 0.0, np.array([sideways, sideways, 1.0]), 2.0)
            rows.append(
                (
                    heights(published, image, believed, region),
                    *_in_world(ours.see(image, believed), believed, TILT_STD),
                    *_in_world(exact.see(image, where.attitude), where.attitude, 0.0),
                )
            )
    published_heights, seen, variance, exact_seen, exact_variance = map(np.array, zip(*rows, strict=True))
    bound = height_bound(MARK, setup, edge_noise(LIGHT_WELL))
    return Minute(
        height, t_gps, gps, t_baro, baro, times, published_heights, seen, variance, exact_seen, exact_variance, bound,
        image,
    )  # fmt: skip


def _walk(value: Floats, std: float, tau: float, dt: float, rng: np.random.Generator) -> Floats:
    return np.array([gauss_markov(v, std, tau, dt, n) for v, n in zip(value, rng.standard_normal(2), strict=True)])


def _tilted(attitude: Floats, by: Floats) -> Floats:
    roll, pitch, heading = angles(attitude)
    return np.asarray(quaternion(roll + by[0], pitch + by[1], heading))


def _in_world(sighting: PadSighting | None, attitude: Floats, tilt_std: float) -> tuple[float, float]:
    """Height of the camera that a sighting means [m] and its variance [m^2]; NaN without one."""
    if sighting is None:
        return math.nan, math.nan
    turn = matrix(attitude) @ MOUNT.axes
    e, n, u = turn @ sighting.position
    variance = (turn @ sighting.covariance[:3, :3] @ turn.T)[2, 2]
    return -u, variance + tilt_std**2 * (e * e + n * n)


def _instruments(
    height: float, landing: int, seconds: float, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats, Floats]:
    """Times and heights of the world's own GPS receiver and barometer, standing still."""
    carrier = vehicle.load("raptor90")
    site = carrier.site(SURFACE_PRESSURE, SURFACE_TEMPERATURE, np.array([0.0, 22.0, -42.0]))
    site = replace(site, skid_height=0.0)
    receiver = Gps(dict(carrier.sensors["gps"].numbers) | GPS | {"rate": GPS_RATE}, np.zeros(3), site, rng)
    barometer = Barometer(dict(carrier.sensors["baro"].numbers) | BARO | {"rate": BARO_RATE}, np.zeros(3), site, rng)
    still = Truth(
        t=0.0, position=np.array([0.0, 0.0, height]), velocity=np.zeros(3), quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
        rotation=np.eye(3), rates=np.zeros(3), angular_acceleration=np.zeros(3),
        specific_force=np.array([0.0, 0.0, GRAVITY]), rotor_speed=0.0, thrust=0.0, inflow=0.0, wind=np.zeros(3),
        pressure=float(pressure_at(height, SURFACE_PRESSURE, SURFACE_TEMPERATURE)),
        temperature=float(temperature_at(height, SURFACE_TEMPERATURE)),
    )  # fmt: skip
    t_gps, t_baro = np.arange(0.0, seconds, 1.0 / GPS_RATE), np.arange(0.0, seconds, 1.0 / BARO_RATE)
    gps, baro = [], []
    for still.t in t_gps.tolist():
        burst = BURST if landing == 0 and BURST_FROM <= still.t < BURST_TO else 0.0
        receiver.numbers["bias_u"] = GPS["bias_u"] + burst
        gps.append(receiver.sample(still).u)
    for still.t in t_baro.tolist():
        baro.append(barometer.sample(still).altitude)
    return t_gps, np.array(gps), t_baro, np.array(baro)
