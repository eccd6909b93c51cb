"""One flight over the ring landmark in turbulence: pictures drawn from where it truly was, and what is made of them."""

import math
import tempfile
import time
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from estimators.vision.ring_pose import RingPoseFrontEnd
from estimators.vision.sighting import PadPrediction, PadSighting
from estimators.wu_ekf import READINGS, Reading, WuFilter, WuNoise
from flightlog.camera import CameraMount
from flightlog.constants import GRAVITY
from flightlog.marks import RingMark
from flightlog.readers.folder import Flight, read_flight
from flightlog.rotations import from_angles
from flightlog.tables import Table
from scenarios.experiments.drawn_pad import DrawnPad
from scenarios.flight import fly
from scenarios.load import build
from sim import vehicle as vehicles

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

WIND = {"light": 2.0, "moderate": 3.0, "severe": 4.0}  # [m/s] mean: what carries the turbulence past
HEIGHT = 9.0  # [m]
SETTLE = 12.0  # [s] before the first picture: the helicopter starts trimmed for still air
RATE = 25.0  # [Hz] of pictures
GLARE_EVERY, GLARE = 4.0, 0.4  # [s]
GRAIN = 0.01  # [m] that a prediction is never surer of
NOISE = WuNoise(vision=0.004)  # [m] what ellipse and LHM state at this height
MARK = RingMark()


@dataclass(frozen=True, eq=False)
class Track:
    """What was made of one flight's N pictures; places (N, 3) [m] in camera axes, NaN where there is none."""

    air: str
    t: Floats  # (N,) [s]
    true: Floats
    whole: Floats  # by ellipse and LHM in the whole picture
    region: Floats  # the same in the region that the filter predicts
    filtered: Floats  # by the corrected filter, fed by `region`
    readings: dict[Reading, Floats]  # by each reading of the filter, fed by `whole`
    whole_ms: Floats  # (N,) processor time of one thread
    region_ms: Floats  # (N,)
    example: Image  # (H, W, 3) RGB
    tilt: float  # [rad] largest


@dataclass(frozen=True, eq=False)
class Carrier:
    """What is known aboard between the pictures."""

    t: Floats  # (M,) [s] of the inertial samples
    acceleration: Floats  # (M, 3) [m/s^2] world, of the time before each
    axes: Floats  # (M, 3, 3) columns: the camera's axes in the world
    lever: Floats  # (3,) [m] of the camera from the body origin, camera axes
    period: int  # inertial samples from picture to picture

    @classmethod
    def of(cls, imu: Table, estimate: Table, mount: CameraMount, start: float, end: float) -> "Carrier":
        """From measurements and the attitude as estimated aboard, between two times [s]."""
        rows = np.flatnonzero((imu["t"] >= start) & (imu["t"] < end))
        t = imu["t"][rows]
        turns = attitudes(estimate, t)
        force = np.column_stack([imu[name][rows] for name in ("fx", "fy", "fz")])
        return cls(
            t, turns.apply(force) - [0.0, 0.0, GRAVITY], turns.as_matrix() @ mount.axes,
            mount.axes.T @ mount.position, round(1.0 / RATE / float(np.median(np.diff(t)))),
        )  # fmt: skip

    def to_world(self, k: int, place: Floats) -> Floats:
        """Body origin (3,) in the world from the landmark's place (3,) in the camera's axes at picture k."""
        return np.asarray(-self.axes[k * self.period] @ (place + self.lever))

    def to_camera(self, k: int, origin: Floats) -> Floats:
        """The other way round."""
        return np.asarray(-self.axes[k * self.period].T @ origin - self.lever)


class Follower:
    """The paper's filter, from picture to picture."""

    def __init__(self, carrier: Carrier, reading: Reading) -> None:
        self._carrier, self._reading = carrier, reading
        self._filter: WuFilter | None = None

    def advance(self, k: int) -> None:
        """On to picture k from the one before."""
        carrier, filtered = self._carrier, self._filter
        if filtered is None:
            return
        for row in range((k - 1) * carrier.period + 1, k * carrier.period + 1):
            filtered.predict(carrier.acceleration[row], float(carrier.t[row] - carrier.t[row - 1]))

    def correct(self, k: int, place: Floats) -> None:
        """The landmark seen at `place` (3,) in picture k."""
        origin = self._carrier.to_world(k, place)
        if self._filter is None:
            self._filter = WuFilter(origin, np.zeros(3), noise=NOISE, reading=self._reading)
        self._filter.correct(origin)

    def place(self, k: int) -> Floats:
        """Where it has the landmark (3,) in picture k."""
        return np.full(3, np.nan) if self._filter is None else self._carrier.to_camera(k, self._filter.x[:3])

    def expect(self, k: int) -> PadPrediction | None:
        """The same with its uncertainty."""
        if self._filter is None:
            return None
        axes = self._carrier.axes[k * self._carrier.period]
        std = np.sqrt(np.diag(axes.T @ self._filter.p[:3, :3] @ axes) + GRAIN**2)
        return PadPrediction(self.place(k), 0.0, std, math.pi)


def attitudes(table: Table, t: Floats) -> Rotation:
    """Rotations body to world at the times (N,) [s], from a log's roll, pitch and heading."""
    return Slerp(table["t"], from_angles(table["roll"], table["pitch"], table["heading"]))(t)


def columns(table: Table, names: str, t: Floats) -> Floats:
    """Columns (N, M) of a log at the times (N,) [s]."""
    return np.column_stack([np.interp(t, table["t"], table[name]) for name in names.split()])


def track(air: str, seed: int, seconds: float) -> Track:
    """Fly once in `air` of that class, draw what the camera saw, and find the landmark in it."""
    scenario = build(
        pad="ring", duration_s=SETTLE + seconds, start={"position_m": [0.2, -0.2, HEIGHT]},
        plan={"goal": "hover", "point_m": [0.0, 0.0, HEIGHT]}, weather={"turbulence": air, "wind_m_s": WIND[air]},
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        fly(scenario, seed=seed, cameras=False, folder=f"{folder}/flight")
        return _look(air, seed, read_flight(f"{folder}/flight"), SETTLE + seconds - 0.1)


def _look(air: str, seed: int, log: Flight, end: float) -> Track:
    rng = np.random.default_rng([seed, 1])
    down, state = vehicles.load("raptor90").cameras["down"], log.truth["state"]
    pad = DrawnPad(MARK, down.model, down.mount)
    carrier = Carrier.of(log.measured["imu"], log.measured["estimate"], down.mount, SETTLE, end)
    t = carrier.t[:: carrier.period]
    position, velocity = columns(state, "e n u", t), columns(state, "ve vn vu", t)
    rates, turns = columns(state, "wx wy wz", t), attitudes(state, t)
    cameras = turns.as_matrix() @ down.mount.axes
    true = np.asarray(-np.einsum("nji,nj->ni", cameras, position) - carrier.lever)

    broad, narrow = (RingPoseFrontEnd(down.model, down.mount, MARK, roi=roi) for roi in (False, True))
    followed, others = Follower(carrier, "corrected"), {name: Follower(carrier, name) for name in READINGS}
    whole, region, filtered = (np.full((len(t), 3), np.nan) for _ in range(3))
    readings = {name: np.full((len(t), 3), np.nan) for name in READINGS}
    whole_ms, region_ms = np.full(len(t), np.nan), np.full(len(t), np.nan)
    example = np.zeros((1, 1, 3), np.uint8)
    for k in range(len(t)):
        image = pad.picture(position[k], turns[k].as_quat(scalar_first=True), velocity[k], rates[k], rng)
        if (t[k] - t[0]) % GLARE_EVERY > GLARE_EVERY - GLARE:
            image = np.full_like(image, 255)
        attitude = Rotation.from_matrix(carrier.axes[k * carrier.period] @ down.mount.axes.T).as_quat(scalar_first=True)
        for follower in (followed, *others.values()):
            follower.advance(k)
        seen, whole_ms[k] = _timed(broad, image, attitude, None)
        if seen is not None:
            whole[k] = seen.position
            for follower in others.values():
                follower.correct(k, seen.position)
        seen, region_ms[k] = _timed(narrow, image, attitude, followed.expect(k))
        if seen is not None:
            region[k] = seen.position
            followed.correct(k, seen.position)
            if len(example) == 1 and k >= 12:
                example = _drawn(image, seen)
        filtered[k] = followed.place(k)
        for name, follower in others.items():
            readings[name][k] = follower.place(k)
    late = state["t"] >= SETTLE
    tilt = max(float(np.max(np.abs(state[name][late]))) for name in ("roll", "pitch"))
    return Track(air, t, true, whole, region, filtered, readings, whole_ms, region_ms, example, tilt)


def _timed(
    eye: RingPoseFrontEnd, image: Image, attitude: Floats, prediction: PadPrediction | None
) -> tuple[PadSighting | None, float]:
    begin = time.thread_time()
    seen = eye.see(image, attitude, prediction)
    return seen, 1e3 * (time.thread_time() - begin)


def _drawn(image: Image, seen: PadSighting) -> Image:
    """The picture with the outline found, RGB."""
    picture = cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
    corners = np.rint(16 * seen.outline).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(picture, [corners], True, (255, 60, 60), 2, cv2.LINE_AA, 4)
    return np.asarray(picture, np.uint8)
