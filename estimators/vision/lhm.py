"""Pose from points by orthogonal iteration (Lu, Hager and Mjolsness 2000), as functions of arrays.

A point R p_i + t should lie on its line of sight v_i. What it misses by, in space, is least for

    t(R) = (I - 1/n sum V_j)^-1 1/n sum (V_j - I) R p_j,    V_j = v_j v_j' / v_j' v_j

and R is found by turning in circles: q_i = V_i (R p_i + t(R)), then R as the absolute orientation from p to q. Each
round lessens the error. All of it is linear in the nine numbers of R but the last step, so the sums over the points are
taken once and a round costs the same for any number of points.

A flat object has a second minimum (Schweighofer and Pinz 2006), roughly its mirror image about the line of sight;
along the arc between them the error is a trigonometric polynomial whose minima are roots of a quartic.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]

ROUNDS = 2000
SETTLED = 1e-9  # [rad] change of the rotation in a round
LEAP_EVERY = 4  # rounds
EARLY, NEWTON = 4, 20  # rounds before Newton's steps are tried; their number
LONGEST, ARRIVED = 0.3, 1e-8  # [rad] of a step; of the last
MIRRORED = math.radians(0.05)  # minima closer than this are one
CUBE = Rotation.create_group("O").as_matrix()  # (24, 3, 3) of a cube upon itself


_TURNS = np.array([
    [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]], [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
])  # fmt: skip


@dataclass(frozen=True, eq=False)
class PointPose:
    """Pose of an object: p in camera axes = rotation @ p + translation."""

    rotation: Floats  # (3, 3)
    translation: Floats  # (3,) unit of the points
    error: float  # sum over the points of the squared distance to the line of sight, unit of the points squared
    rounds: int


@dataclass(frozen=True, eq=False)
class Sums:
    """What the points and their lines of sight come to. r is R row by row (9,)."""

    shift: Floats  # (..., 3, 9): t = shift r
    turn: Floats  # (..., 9, 9): sum of q_i (p_i - mean p)', row by row, = turn r
    energy: Floats  # (..., 9, 9): the error = r' energy r
    spread: Floats  # (..., 3, 3) start of the iteration: sum of v_i (p_i - mean p)' with v_i at unit depth


def gather(points: Floats, rays: Floats) -> Sums:
    """The sums for points (N, 3) seen along rays (..., N, 3), z > 0, of any length; any number of pictures at once."""
    points, rays = np.asarray(points, float), np.asarray(rays, float)
    sight = rays[..., :, None] * rays[..., None, :] / np.sum(rays * rays, axis=-1)[..., None, None]
    count = len(points)
    # R p = arms r
    arms = np.zeros((count, 3, 9))
    for axis in range(3):
        arms[:, axis, 3 * axis : 3 * axis + 3] = points
    miss = sight - np.eye(3)
    shift = np.linalg.solve(-miss.mean(axis=-3), np.einsum("...nij,njk->...ik", miss, arms) / count)
    placed = arms + shift[..., None, :, :]
    missed = miss @ placed
    energy = np.einsum("...nij,...nik->...jk", missed, missed)
    about = points - points.mean(axis=0)
    turn = np.einsum("...nij,nk->...ikj", sight @ placed, about)
    flat = rays / rays[..., 2:]
    spread = np.einsum("...ni,nj->...ij", flat - flat.mean(axis=-2, keepdims=True), about)
    return Sums(shift, turn.reshape(*turn.shape[:-3], 9, 9), energy, spread)


def nearest_rotation(m: Floats) -> Floats:
    """The rotations (..., 3, 3) that maximise trace(R' m)."""
    u, _, v = np.linalg.svd(m)
    u[..., :, 2] *= np.sign(np.linalg.det(u @ v))[..., None]
    return np.asarray(u @ v)


def iterate(sums: Sums, start: Floats, rounds: int = ROUNDS, settled: float = SETTLED) -> tuple[Floats, int]:
    """Rotations (..., 3, 3) from `start`, and the rounds they took: until all change by less than `settled` [rad].

    Near a minimum each round goes the same share of the way, a small one where the object is flat and far. So every
    few rounds the iteration leaps to where the last two steps, as a geometric series, would lead, if that lessens the
    error; without leaps it is the original.
    """
    rotation = np.asarray(start, float)
    shape = rotation.shape
    before = np.zeros_like(rotation)
    number = 0
    for number in range(1, rounds + 1):
        following = nearest_rotation((sums.turn @ rotation.reshape(*shape[:-2], 9, 1)).reshape(shape))
        step = following - rotation
        change = float(np.max(np.abs(step)))
        if change < settled:
            rotation = following
            break
        if number % LEAP_EVERY == 0:
            square = np.sum(before * before, axis=(-2, -1), keepdims=True)
            along = np.sum(step * before, axis=(-2, -1), keepdims=True)
            ratio = np.clip(along / np.maximum(square, 1e-300), 0.0, 0.999)
            leapt = nearest_rotation(following + step * ratio / (1.0 - ratio))
            better = error(sums, leapt) < error(sums, following)
            following = np.where(better[..., None, None], leapt, following)
        before, rotation = step, following
    return rotation, number


def polish(sums: Sums, start: Floats, steps: int = NEWTON) -> Floats | None:
    """The minimum (3, 3) downhill from the rotation `start` (3, 3), by Newton's steps on the same error.

    sums of one picture. The iteration comes near fast and arrives slowly; this is the other way round. Where the error
    bends down, as between the two minima of a flat object, the step goes downhill too. None where it has not arrived
    after so many `steps`.
    """
    rotation = np.asarray(start, float)
    before = float(error(sums, rotation))
    for _ in range(steps):
        slopes = (_TURNS @ rotation).reshape(3, 9)
        pull = sums.energy @ rotation.ravel()
        bend = rotation @ pull.reshape(3, 3).T
        curvature = slopes @ sums.energy @ slopes.T + 0.5 * (bend + bend.T) - np.trace(bend) * np.eye(3)
        values, vectors = np.linalg.eigh(curvature)
        step = -vectors @ ((slopes @ pull) @ vectors / np.maximum(np.abs(values), 1e-9 * abs(values[-1])))
        length = float(np.linalg.norm(step))
        step *= min(1.0, LONGEST / max(length, 1e-300))
        if length < ARRIVED:
            return rotation if values[0] > 0.0 else None
        for _ in range(5):
            following = cv2.Rodrigues(step)[0] @ rotation
            after = float(error(sums, following))
            if after < before:
                break
            step *= 0.4
        else:
            # numbers end before the minimum does
            return rotation if length < 1e-5 and values[0] > 0.0 else None
        rotation, before = following, after
    return None


def descend(sums: Sums, start: Floats, settled: float = SETTLED) -> tuple[Floats, int]:
    """The minimum (3, 3) to which one picture's iteration leads from `start`, and the rounds it took."""
    rotation, rounds = iterate(sums, start, EARLY, settled)
    near = polish(sums, rotation)
    if near is not None:
        return near, rounds
    rotation, more = iterate(sums, rotation, ROUNDS, settled)
    return rotation, rounds + more


def translation(sums: Sums, rotation: Floats) -> Floats:
    """The best translations (..., 3) that go with rotations (..., 3, 3)."""
    return np.asarray((sums.shift @ rotation.reshape(*rotation.shape[:-2], 9, 1))[..., 0])


def error(sums: Sums, rotation: Floats) -> Floats:
    """Squared distances to the lines of sight (...), summed over the points, for rotations (..., 3, 3)."""
    r = rotation.reshape(*rotation.shape[:-2], 9)
    return np.asarray(np.einsum("...i,...ij,...j->...", r, sums.energy, r))


def second_start(sums: Sums, rotation: Floats) -> Floats | None:
    """Where to look for a flat object's other minimum (3, 3), from one of its minima; None where there is no other.

    sums of one picture. With z' along the line of sight and the object's rotation Rz'(a) Ry'(b) Rz(c), the other
    minimum has another b and, nearly, the same a and c (Schweighofer and Pinz 2006, section 4).
    """
    sight = translation(sums, rotation)
    z = sight / np.linalg.norm(sight)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    frame = np.stack([x, np.cross(z, x), z])  # rows: camera axes to those of the line of sight
    turned = frame @ rotation
    b = math.atan2(math.hypot(turned[0, 2], turned[1, 2]), turned[2, 2])
    if math.sin(b) < 1e-9:
        return None
    a = math.atan2(turned[1, 2], turned[0, 2])
    about_z = np.array([[math.cos(a), -math.sin(a), 0.0], [math.sin(a), math.cos(a), 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[math.cos(b), 0.0, math.sin(b)], [0.0, 1.0, 0.0], [-math.sin(b), 0.0, math.cos(b)]])
    inner = about_y.T @ about_z.T @ turned
    # rotation as 1, cos, sin of b, row by row
    basis = [np.diag([0.0, 1.0, 0.0]), np.diag([1.0, 0.0, 1.0]), np.array([[0, 0, 1.0], [0, 0, 0], [-1.0, 0, 0]])]
    spans = np.stack([(frame.T @ about_z @ part @ inner).ravel() for part in basis])
    g = spans @ sums.energy @ spans.T
    other = [angle for angle in _minima(g) if abs(math.remainder(angle - b, 2.0 * math.pi)) > MIRRORED]
    if not other:
        return None

    def height(angle: float) -> float:
        u = np.array([1.0, math.cos(angle), math.sin(angle)])
        return float(u @ g @ u)

    best = min(other, key=height)
    u = np.array([1.0, math.cos(best), math.sin(best)])
    return np.asarray((u @ spans).reshape(3, 3))


def _minima(g: Floats) -> list[float]:
    """Angles b [rad] at which u' g u is least nearby, u = (1, cos b, sin b)."""
    # the derivative is A cos b + B sin b + C cos 2b + D sin 2b; in z = exp(i b) a quartic
    p, q = 2.0 * g[0, 2], -2.0 * g[0, 1]
    r, s = 2.0 * g[1, 2], g[2, 2] - g[1, 1]
    roots = np.roots([r - 1j * s, p - 1j * q, 0.0, p + 1j * q, r + 1j * s])
    on_circle = roots[np.abs(np.abs(roots) - 1.0) < 1e-5]
    angles = np.angle(on_circle)
    curvature = -p * np.sin(angles) + q * np.cos(angles) - 2.0 * r * np.sin(2 * angles) + 2.0 * s * np.cos(2 * angles)
    return [float(angle) for angle, bend in zip(angles, curvature, strict=True) if bend > 0.0]


def solve(
    points: Floats, rays: Floats, start: Floats | None = None, *, flat: bool = True, settled: float = SETTLED
) -> list[PointPose]:
    """Poses of an object of points (N, 3), N >= 4, seen along rays (N, 3) with z > 0 in camera axes; the best first.

    start (3, 3): where the iteration begins; by default the weak perspective of the original. flat: all points have
    z = 0, look for the second minimum; else the beginning is also turned as a cube upon itself and the best is kept,
    since few points of a solid object leave the weak perspective in a wrong valley now and then. settled [rad]: as
    `iterate` has it. Poses that put the object behind the camera are left out.
    """
    sums = gather(points, rays)
    begin = nearest_rotation(sums.spread) if start is None else np.asarray(start, float)
    if not flat:
        found = [_pose(sums, turned, settled) for turned in (begin @ CUBE if start is None else [begin])]
        return sorted((pose for pose in found if pose.translation[2] > 0.0), key=lambda pose: pose.error)[:1]
    found = [_pose(sums, begin, settled)]
    for second in (second_start(sums, found[0].rotation), _mirrored(found[0])):
        other = None if second is None else _pose(sums, second, settled)
        if other is not None and np.max(np.abs(found[0].rotation - other.rotation)) >= MIRRORED:
            found.append(other)
            break
    return sorted((pose for pose in found if pose.translation[2] > 0.0), key=lambda pose: pose.error)


def _pose(sums: Sums, begin: Floats, settled: float) -> PointPose:
    """Where the iteration from one beginning ends."""
    rotation, rounds = descend(sums, begin, settled)
    return PointPose(rotation, translation(sums, rotation), float(error(sums, rotation)), rounds)


def _mirrored(pose: PointPose) -> Floats:
    """(3, 3) the other attitude in which a flat object looks alike from far away: its plane tilted the other way."""
    sight = pose.translation / np.linalg.norm(pose.translation)
    return np.asarray((np.eye(3) - 2.0 * np.outer(sight, sight)) @ pose.rotation * [1.0, 1.0, -1.0])


def covariance(points: Floats, pose: PointPose, std_ray: float | Floats) -> Floats:
    """Covariance (6, 6) of translation and rotation vector [rad], camera axes, to first order.

    std_ray: standard deviation of the errors of the rays' x/z and y/z, one for all or (N,).
    """
    arms = np.asarray(points, float) @ pose.rotation.T
    x, y, z = (arms + pose.translation).T
    slopes = np.zeros((len(x), 2, 3))
    slopes[:, 0, 0] = slopes[:, 1, 1] = 1.0 / z
    slopes[:, 0, 2], slopes[:, 1, 2] = -x / z**2, -y / z**2
    cross = np.zeros((len(x), 3, 3))  # a small rotation e moves an arm by e x arm
    cross[:, 0, 1], cross[:, 0, 2] = arms[:, 2], -arms[:, 1]
    cross[:, 1, 0], cross[:, 1, 2] = -arms[:, 2], arms[:, 0]
    cross[:, 2, 0], cross[:, 2, 1] = arms[:, 1], -arms[:, 0]
    jacobian = np.concatenate([slopes, slopes @ cross], axis=2)
    jacobian = (jacobian / np.broadcast_to(std_ray, len(points))[:, None, None]).reshape(-1, 6)
    return np.asarray(np.linalg.inv(jacobian.T @ jacobian))
