"""The pad as the down camera and its front end would report it, without a picture: for Monte Carlo flights.

The model is the front end's own statistics. Each pixel of the mark's outline that lies in the picture measures its
offset along the edge's normal with a standard deviation of `edge_noise`. From these follow the 4 x 4 covariance of
(x, y, z, angle), with two nuisances that the front end solves for under a prior: the tilt of the attitude that it was
given, and the bleed that makes a bright mark look larger. A mark cut by the picture's edge therefore loses accuracy
in just the directions whose edges are gone: there the prediction stands, and the stated deviation is metres. For a
whole 1 m H at 10 m and 0.1 px the height's deviation is 1.3 mm.

On top come a jitter of the whole mark, an error of its apparent size that varies slowly (what sub-pixel edges of a
sampled picture have in common), and a scale error of the flight (the focal length is known to no better).
`edge_noise`, `centre_noise`, `size_noise` and `angle_noise` are fitted to rendered pictures: benchmarks/pad_camera.py.
"""

import math
from collections.abc import Mapping
from typing import ClassVar

import numba
import numpy as np

from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import HMark, Mark
from flightlog.signals import PadSample
from sim.parameters import Parameter
from sim.sensors.contract import Floats, Site, Truth
from sim.sensors.device import LATENCY, RATE, Device
from sim.sensors.noise import gauss_markov

SAMPLE_SPACING = 0.05  # [m] along the outline
CLEAR = 5.0  # [px] a round edge nearer than this to another is not told apart from it

_OPEN_STD = 3.0  # [m], [rad]: what the front end says of a direction that no visible edge measures


@numba.njit(cache=True)
def _information(position, rotation, mount, axes, mark_axis, intrinsics, margin, samples, k1=0.0):
    """Centre of the mark in camera axes (3,), its angle, Fisher information (7, 7) at 1 px, share in the picture.

    And the pull (7,) of a lens that moves every point outward by k1 of its squared distance from the axis, in the
    information's order and unit.

    The information's order is x, y, z [m], angle [rad], tilt about the camera's x and y [rad], bleed [px].
    samples (N, 6): points of the outline and unit tangents in mark axes [m], length [m] that each stands for, and
    clearance [m] to the next edge;
    mark_axis (2,): east and north of the mark's y axis. intrinsics: width, height, fx, fy, cx, cy.
    The angle's zero is image up, made level.
    """
    turn = np.ascontiguousarray(rotation) @ axes  # camera to world
    cx = -position[0] - (rotation[0, 0] * mount[0] + rotation[0, 1] * mount[1] + rotation[0, 2] * mount[2])
    cy = -position[1] - (rotation[1, 0] * mount[0] + rotation[1, 1] * mount[1] + rotation[1, 2] * mount[2])
    cz = -position[2] - (rotation[2, 0] * mount[0] + rotation[2, 1] * mount[1] + rotation[2, 2] * mount[2])
    centre = np.empty(3)
    along = np.empty(3)  # the mark's y in camera axes
    across = np.empty(3)  # the mark's x
    for i in range(3):
        centre[i] = turn[0, i] * cx + turn[1, i] * cy + turn[2, i] * cz
        along[i] = turn[0, i] * mark_axis[0] + turn[1, i] * mark_axis[1]
        across[i] = turn[0, i] * mark_axis[1] - turn[1, i] * mark_axis[0]
    # azimuth of the mark's axis less that of image up, which is the camera's -y
    angle = math.atan2(mark_axis[0], mark_axis[1]) - math.atan2(-turn[0, 1], -turn[1, 1])
    information = np.zeros((7, 7))
    pull = np.zeros(7)
    row = np.empty(7)
    seen = 0.0
    total = 0.0
    for k in range(samples.shape[0]):
        x, y, length = samples[k, 0], samples[k, 1], samples[k, 4]
        total += length
        ax = x * across[0] + y * along[0]
        ay = x * across[1] + y * along[1]
        az = x * across[2] + y * along[2]
        pz = centre[2] + az
        if pz < 0.05:
            continue
        tan_x, tan_y = (centre[0] + ax) / pz, (centre[1] + ay) / pz
        u = intrinsics[2] * tan_x + intrinsics[4]
        v = intrinsics[3] * tan_y + intrinsics[5]
        if u < margin or v < margin or u > intrinsics[0] - 1.0 - margin or v > intrinsics[1] - 1.0 - margin:
            continue
        seen += length
        px, py = intrinsics[2] / pz, intrinsics[3] / pz  # [px/m]
        tx = samples[k, 2] * across[0] + samples[k, 3] * along[0]
        ty = samples[k, 2] * across[1] + samples[k, 3] * along[1]
        tz = samples[k, 2] * across[2] + samples[k, 3] * along[2]
        du, dv = px * (tx - tan_x * tz), py * (ty - tan_y * tz)  # the edge in the picture [px/m]
        pitch = math.sqrt(du * du + dv * dv)
        if pitch < 1e-9 or samples[k, 5] * min(px, py) < CLEAR:
            continue
        nu, nv = dv / pitch, -du / pitch
        jx, jy = nu * px, nv * py
        jz = -jx * tan_x - jy * tan_y
        row[0], row[1], row[2] = jx, jy, jz
        # clockwise seen from above: y towards x, x away from y
        row[3] = (
            jx * (y * across[0] - x * along[0]) + jy * (y * across[1] - x * along[1])
            + jz * (y * across[2] - x * along[2])
        )  # fmt: skip
        row[4] = jz * ay - jy * az  # e_x x arm
        row[5] = jx * az - jz * ax  # e_y x arm
        row[6] = 1.0
        weight = pitch * length  # pixels of edge
        outward = k1 * (tan_x * tan_x + tan_y * tan_y)
        moved = outward * (nu * intrinsics[2] * tan_x + nv * intrinsics[3] * tan_y)  # [px] along the normal
        for i in range(7):
            pull[i] += weight * moved * row[i]
            for j in range(i + 1):
                information[i, j] += weight * row[i] * row[j]
    for i in range(7):
        for j in range(i):
            information[j, i] = information[i, j]
    return centre, angle, information, pull, seen / total


@numba.njit(cache=True)
def _inverse(a):
    """Inverse of the symmetric positive definite `a`, whose unknowns may differ by many orders of magnitude."""
    n = a.shape[0]
    scale = np.empty(n)
    for i in range(n):
        scale[i] = 1.0 / math.sqrt(a[i, i])
    even = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            even[i, j] = a[i, j] * scale[i] * scale[j]
        even[i, i] += 1e-12
    root = np.linalg.inv(np.linalg.cholesky(even))
    inverse = root.T @ root  # never a negative variance
    for i in range(n):
        for j in range(n):
            inverse[i, j] *= scale[i] * scale[j]
    return inverse


@numba.njit(cache=True)
def _solve(
    information, pull, edge_noise, predicted_std, predicted_angle_std, tilt_std, bleed_std, tilt_x, tilt_y, bleed,
    normal,
):
    """One draw (4,) of the pose's error and the variances (4,) that the front end states.

    The fit starts from a prediction, which holds what no edge measures; the stated variances leave it out. tilt and
    bleed: how far they really are from what the fit takes for granted. pull: see `_information`. normal: eleven numbers
    or more.
    """
    scaled = information / (edge_noise * edge_noise)
    stated = scaled.copy()
    held = scaled.copy()
    for i in range(7):
        std = predicted_std if i < 3 else predicted_angle_std if i < 4 else tilt_std if i < 6 else bleed_std
        held[i, i] += 1.0 / (std * std)
        stated[i, i] += 1.0 / (_OPEN_STD * _OPEN_STD) if i < 4 else 1.0 / (std * std)
        # a Cholesky factor also where an unknown is not seen at all
        scaled[i, i] = scaled[i, i] * (1.0 + 1e-9) + 1e-12
    noise = np.linalg.cholesky(scaled) @ normal[:7]
    for i in range(3):
        noise[i] += normal[7 + i] / predicted_std
    noise[3] += normal[10] / predicted_angle_std
    noise[4] += tilt_x / (tilt_std * tilt_std)
    noise[5] += tilt_y / (tilt_std * tilt_std)
    noise[6] += bleed / (bleed_std * bleed_std)
    e = _inverse(held) @ (noise + pull / (edge_noise * edge_noise))
    covariance = _inverse(stated)
    return (e[0], e[1], e[2], e[3]), (covariance[0, 0], covariance[1, 1], covariance[2, 2], covariance[3, 3])


def _outline(mark: Mark) -> Floats:
    """Samples (N, 6): middle [m], unit tangent, length [m], each about SAMPLE_SPACING long, clearance [m].

    Straight edges are taken to be clear of others, as an H's are where it is found at all.
    """
    rows = []
    for corners in [mark.outline()] if isinstance(mark, HMark) else mark.bars():
        for start, side in zip(corners, np.roll(corners, -1, axis=0) - corners, strict=True):
            length = float(np.hypot(*side))
            number = math.ceil(length / SAMPLE_SPACING)
            for k in range(number):
                rows.append([*(start + side * (k + 0.5) / number), *(side / length), length / number, math.inf])
    for x, y, radius, _, clearance in () if isinstance(mark, HMark) else mark.circles().tolist():
        number = max(12, math.ceil(2.0 * math.pi * radius / SAMPLE_SPACING))
        for angle in (np.arange(number) * 2.0 * math.pi / number).tolist():
            c, s = math.cos(angle), math.sin(angle)
            rows.append([x + radius * c, y + radius * s, -s, c, 2.0 * math.pi * radius / number, clearance])
    return np.array(rows)


def by_lens(
    positions: Floats, rotations: Floats, camera: CameraModel, mount: CameraMount, mark: Mark, n: Mapping[str, float]
) -> Floats:
    """What a k1 of one beyond the one taken adds to x, y, z [m] and angle [rad] as reported (N, 4), to first order.

    positions (N, 3) [m] and rotations (N, 3, 3) body to world: from where the mark at the origin is looked at; n: the
    front end's numbers by the names of `PadCamera.PARAMETERS`. Zero where no edge is in the picture.
    """
    intrinsics = np.array([camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy], dtype=float)
    lens, axes = np.ascontiguousarray(mount.position, dtype=float), np.ascontiguousarray(mount.axes, dtype=float)
    samples, north = _outline(mark), np.array([0.0, 1.0])
    free = np.array([n["predicted_std"]] * 3 + [n["predicted_angle_std"]] + [n["tilt_std"]] * 2 + [n["bleed_std"]])
    found = np.zeros((len(positions), 4))
    for i, (position, rotation) in enumerate(zip(positions, rotations, strict=True)):
        _, _, information, pull, visible = _information(
            position, rotation, lens, axes, north, intrinsics, n["margin"], samples, 1.0
        )
        if visible > 0.0:
            noise = n["edge_noise"] ** 2
            found[i] = (_inverse(information / noise + np.diag(1.0 / free**2)) @ (pull / noise))[:4]
    return found


class PadCamera(Device):
    """The mark's centre and angle in camera axes; its constructor also wants the camera, its mount and the mark."""

    topic: ClassVar[str] = "pad"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        Parameter("rate", RATE.unit, RATE.low, RATE.high, "samples a second: the down camera's own", 25.0),
        Parameter("latency", LATENCY.unit, LATENCY.low, LATENCY.high, "the down camera's own", 0.06),
        Parameter("edge_noise", "px", 0.001, 10.0, "white noise of one pixel of edge along its normal"),
        Parameter("centre_noise", "px", 0.0, 10.0, "white jitter of the whole mark in the picture"),
        Parameter("size_noise", "px", 0.0, 10.0, "error of half the mark's length in the picture, Gauss-Markov"),
        Parameter("size_tau", "s", 0.01, 1e4, "its time constant"),
        Parameter("angle_noise", "rad", 0.0, 0.1, "white noise of the angle"),
        Parameter("predicted_std", "m", 1e-6, 1.0, "error of the prediction, which stands where no edge measures"),
        Parameter("predicted_angle_std", "rad", 1e-6, 1.0, "the same of the angle"),
        Parameter("tilt_std", "rad", 1e-5, 0.2, "error of the attitude that the front end is given"),
        Parameter("tilt_tau", "s", 0.01, 1e4, "its time constant"),
        Parameter("bleed_std", "px", 1e-3, 5.0, "outward shift of all edges, drawn per flight"),
        Parameter("scale_std", "1", 0.0, 0.1, "error of the focal length, drawn per flight"),
        Parameter("margin", "px", 0.0, 100.0, "edges nearer to the picture's border are not used"),
        Parameter("least_distance", "m", 0.0, 10.0, "camera to mark, along the optical axis: nearer it is lost"),
        Parameter("least_size", "px", 1.0, 500.0, "leg or outermost ring in the picture: smaller it is not found"),
        Parameter("least_visible", "1", 0.0, 1.0, "of the outline: less is not recognised"),
        Parameter("detection_share", "1", 0.0, 1.0, "of the pictures with a whole mark in which it is found"),
        Parameter("cut_detection_share", "1", 0.0, 1.0, "of the pictures with a cut mark in which it is found"),
        Parameter("scale", "1", 0.5, 2.0, "fixed scale, measured distance over true", 1.0),
        Parameter("focal_scale", "1", 0.5, 2.0, "true focal length over the one taken", 1.0),
        Parameter("k1", "1", -1.0, 1.0, "radial distortion of the lens beyond the one taken", 0.0),
        Parameter("delay", "s", 0.0, 1.0, "more latency than is known: the time stamps are late by this", 0.0),
    )
    ERRORS: ClassVar[tuple[tuple[str, str], ...]] = (
        ("x", "m"), ("y", "m"), ("z", "m"), ("angle", "rad"), ("scale", "1"), ("tilt_x", "rad"), ("tilt_y", "rad"),
    )  # fmt: skip

    def __init__(
        self,
        numbers: Mapping[str, float],
        position: Floats,
        site: Site,
        rng: np.random.Generator,
        *,
        camera: CameraModel,
        mount: CameraMount,
        mark: Mark,
        mark_heading: float = 0.0,
    ) -> None:
        """`mount` holds what `position` says, and the axes; mark_heading [rad]: of its y axis, clockwise from north.

        Lens distortion moves edges but hardly their number, so the camera is taken as a pinhole; what it moves them
        by beyond the front end's own lens model is `k1`.
        """
        super().__init__(numbers, position, site, rng)
        self._mount: Floats = np.ascontiguousarray(mount.position, dtype=float)
        self._axes: Floats = np.ascontiguousarray(mount.axes, dtype=float)
        self._intrinsics: Floats = np.array(
            [camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy], dtype=float
        )
        self._samples = _outline(mark)
        self._mark_axis: Floats = np.array([math.sin(mark_heading), math.cos(mark_heading)])
        self._size_of_mark = mark.leg if isinstance(mark, HMark) else mark.size
        self._turn_of_mark = mark.turn
        self._bleed, self._scale = rng.standard_normal(2).tolist()  # in standard deviations, as the tilt
        self._tilt: list[float] = rng.standard_normal(2).tolist()
        self._size = float(rng.standard_normal())
        self._error = (math.nan,) * 7

    def sample(self, truth: Truth) -> PadSample | None:
        """What the front end reports of a picture exposed at `truth`; None where it does not find the mark."""
        n = self.numbers
        normal = self.rng.standard_normal(17)
        *slow, size, jitter_x, jitter_y, twist = normal[11:].tolist()
        found = self.rng.random()
        tilt, dt = self._tilt, self.elapsed(truth.t)
        for i in range(2):
            tilt[i] = gauss_markov(tilt[i], 1.0, n["tilt_tau"], dt, slow[i])
        self._size = gauss_markov(self._size, 1.0, n["size_tau"], dt, size)
        self._error = (math.nan,) * 7
        centre, angle, information, pull, visible = _information(
            truth.position, truth.rotation, self._mount, self._axes, self._mark_axis, self._intrinsics, n["margin"],
            self._samples, n["k1"],
        )  # fmt: skip
        x, y, z = centre.tolist()
        if visible < n["least_visible"] or visible == 0.0 or z < n["least_distance"]:
            return None
        fx, fy = float(self._intrinsics[2]), float(self._intrinsics[3])
        share = n["detection_share"] if visible > 1.0 - 1e-9 else n["cut_detection_share"]
        if self._size_of_mark * min(fx, fy) < n["least_size"] * z or found >= share:
            return None
        tilt_x, tilt_y = n["tilt_std"] * tilt[0], n["tilt_std"] * tilt[1]
        (ex, ey, ez, ea), (vx, vy, vz, va) = _solve(
            information, pull, n["edge_noise"], n["predicted_std"], n["predicted_angle_std"], n["tilt_std"],
            n["bleed_std"], tilt_x, tilt_y, n["bleed_std"] * self._bleed, normal,
        )  # fmt: skip
        std_x, std_y = n["centre_noise"] * z / fx, n["centre_noise"] * z / fy
        std_share = n["size_noise"] * 2.0 * z / (self._size_of_mark * math.sqrt(fx * fy))  # of the distance
        std_twist = n["angle_noise"]
        scale = n["scale"] + n["scale_std"] * self._scale
        # an error of the distance moves the mark along its ray
        stretch = scale * (1.0 + std_share * self._size)
        seen_x = (x + ex) * stretch + std_x * jitter_x
        seen_y = (y + ey) * stretch + std_y * jitter_y
        seen_z = (z + ez) * stretch / n["focal_scale"]  # a longer lens brings the mark near; it lies as far aside
        seen_angle = angle + ea + std_twist * twist
        self._error = (seen_x - x, seen_y - y, seen_z - z, seen_angle - angle, scale, tilt_x, tilt_y)
        t = truth.t + n["delay"]
        return PadSample(
            t,
            t + n["latency"],
            seen_x,
            seen_y,
            seen_z,
            0.5 * self._turn_of_mark - (0.5 * self._turn_of_mark - seen_angle) % self._turn_of_mark,
            math.sqrt(vx + (x * std_share) ** 2 + std_x**2),
            math.sqrt(vy + (y * std_share) ** 2 + std_y**2),
            math.sqrt(vz + (z * std_share) ** 2),
            math.sqrt(va + std_twist**2),
            visible,
            "model",
        )

    def errors(self) -> tuple[float, ...]:
        """Error of the last report, and the scale and tilt behind it; NaN where nothing was reported."""
        return self._error
