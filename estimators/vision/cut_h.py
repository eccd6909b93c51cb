"""An H that the picture's edge cuts: what of its outline is seen, matched edge by edge with the whole outline.

Going round an H, the directions of its twelve edges are known. The straight pieces of a contour that do not lie on the
picture's border, laid on the level plane and turned upright, are matched with every run of them; each match is a linear
equation for centre, width, leg and stroke. What the visible edges leave open comes from the usual proportions.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.contours import Traced
from estimators.vision.pose import LevelAxes, MarkPose, from_pad_plane, on_pad_plane
from flightlog.camera import CameraModel
from flightlog.marks import HMark

Floats = NDArray[np.float64]

BORDER = 2.5  # [px] from the picture's edge: not the mark's
# an outline of this many corners, this share of it in the H's directions: hidden, cut, glaring H's have at most 17, and
# 0.76 or more, grass has 20 to 40, and less than 0.66
MOST_CORNERS, STRAIGHT = 24, 0.65
ALIGNED = math.radians(14.0)  # of an edge to its direction; short ones are ragged
SHORTEST_RUN, SHORTEST_RUN_INSIDE = 3, 5  # edges; of an outline that the picture does not cut
MISFIT = 0.06  # of the leg: RMS of the edges' places
MOST_STARTS, MOST_CONTOURS = 6, 8

# the edges counter-clockwise from the left leg's foot: direction in quarter turns from +x, and the place across it by
# width, leg, stroke (of x for edges along y, of y for edges along x)
QUARTERS = np.array([0, 1, 0, 3, 0, 1, 2, 3, 2, 1, 2, 3])
ROUND = QUARTERS.astype(np.uint8).tobytes() * 3  # as often as the longest run goes round
PLACES = np.array(
    [
        (0, -0.5, 0), (-0.5, 0, 1), (0, 0, -0.5), (0.5, 0, -1), (0, -0.5, 0), (0.5, 0, 0),
        (0, 0.5, 0), (0.5, 0, -1), (0, 0, 0.5), (-0.5, 0, 1), (0, 0.5, 0), (-0.5, 0, 0),
    ]
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Edges:
    """Straight pieces of an outline on the level plane, counter-clockwise seen from above, upright."""

    quarters: NDArray[np.intp]  # (N,) direction in quarter turns
    places: Floats  # (N,) across the direction
    lengths: Floats  # (N,)
    follows: NDArray[np.bool_]  # (N,) begins where the one before ends
    angle: float  # [rad] by which they were turned, from right towards forward


def cut_starts(
    contour: NDArray[np.int32],
    camera: CameraModel,
    level: LevelAxes,
    usual: HMark,
    spread: Floats,
    *,
    shortest: int = SHORTEST_RUN,
) -> Iterator[tuple[MarkPose, HMark]]:
    """Poses and marks that the visible edges of a contour (N, 1, 2) suggest, best first.

    usual: proportions where nothing is seen of them; spread (2,): standard deviations of the logarithms of width and
    stroke over leg; shortest: edges in one run.
    """
    edges = _edges(contour, camera, level)
    if edges is None:
        return
    found: list[tuple[float, MarkPose, HMark]] = []
    for whole_run in _runs(edges):
        # a piece beside the border may be none of the mark's: if the whole run does not match, parts of it may
        for length in range(len(whole_run), shortest - 1, -1):
            before = len(found)
            for first in range(len(whole_run) - length + 1):
                found.extend(_matches(edges, whole_run[first : first + length], level, usual, spread))
            if len(found) > before:
                break
    found.sort(key=lambda one: one[0])
    for _, pose, mark in found[:MOST_STARTS]:
        yield pose, mark


def _matches(
    edges: _Edges, run: list[int], level: LevelAxes, usual: HMark, spread: Floats
) -> Iterator[tuple[float, MarkPose, HMark]]:
    """Misfit, pose and mark of every way in which a run of edges may be part of an H."""
    for turned in range(2):  # an H looks the same after half a turn
        sought = ((edges.quarters[run] + turned) % 4).astype(np.uint8).tobytes()
        for start in range(12):
            if ROUND.startswith(sought, start):
                matched = (start + np.arange(len(run))) % 12
                solution = _solved(edges, run, matched, turned, usual, spread)
                if solution is not None:
                    yield solution[0], *_placed(solution[1], edges.angle, turned, level, usual.leg)


def long_contours(traced: Traced, shortest: float) -> list[tuple[NDArray[np.int32], bool]]:
    """Contours (N, 1, 2) of a mask longer than `shortest` [px], and whether they touch its border."""
    height, width = traced.mask.shape
    kept = []
    for contour in traced.contours:
        if len(contour) >= shortest:
            x, y, w, h = cv2.boundingRect(contour)
            cut = x <= 0 or y <= 0 or x + w >= width or y + h >= height
            kept.append((contour, cut))
    return sorted(kept, key=lambda one: -len(one[0]))[:MOST_CONTOURS]


def enough_seen(corners: Floats, camera: CameraModel) -> bool:
    """Whether of an H's corners (12, 2) [px] the picture shows three leg ends, or both inner corners of one side."""
    inside = camera.contains(corners, 1.0)
    ends = inside[[0, 4, 6, 10]] & inside[[1, 5, 7, 11]]
    return bool(ends.sum() >= 3 or inside[[2, 3]].all() or inside[[8, 9]].all())


def _edges(contour: NDArray[np.int32], camera: CameraModel, level: LevelAxes) -> _Edges | None:
    """The straight pieces that are the mark's own."""
    perimeter = cv2.arcLength(contour, True)
    corners = cv2.approxPolyDP(contour, float(np.clip(0.008 * perimeter, 1.5, 10.0)), True).reshape(-1, 2).astype(float)
    if not 4 <= len(corners) <= MOST_CORNERS:
        return None
    size = np.array([camera.width - 1.0, camera.height - 1.0])
    near_low, near_high = corners <= BORDER, corners >= size - BORDER
    following = np.roll(np.arange(len(corners)), -1)
    on_border = np.any((near_low & near_low[following]) | (near_high & near_high[following]), axis=1)
    flat = on_pad_plane(corners, camera, level)
    if not np.all(np.isfinite(flat)):
        return None
    # contours run clockwise or not, according to what they enclose
    if cv2.contourArea(flat.astype(np.float32), True) < 0:
        flat, on_border = flat[::-1], np.roll(on_border[::-1], -1)
    sides = np.roll(flat, -1, axis=0) - flat
    lengths = np.hypot(*sides.T)
    directions = np.arctan2(sides[:, 1], sides[:, 0])
    weights = np.where(on_border, 0.0, lengths**2)
    if weights.sum() <= 0.0:
        return None
    angle = float(np.angle((weights * np.exp(4j * directions)).sum())) / 4
    upright = directions - angle
    quarters = np.rint(upright / (math.pi / 2)).astype(int)
    good = ~on_border & (np.abs(upright - quarters * math.pi / 2) < ALIGNED)
    c, s = math.cos(angle), math.sin(angle)
    middle = (flat + 0.5 * sides) @ np.array([[c, -s], [s, c]])
    quarters %= 4
    places = np.where(quarters % 2 == 0, middle[:, 1], middle[:, 0])
    if good.sum() < SHORTEST_RUN or lengths[good].sum() < STRAIGHT * lengths[~on_border].sum():
        return None
    index = np.flatnonzero(good)
    # an edge follows the one before in the contour, if that was kept
    return _Edges(quarters[index], places[index], lengths[index], good[index - 1], angle)


def _runs(edges: _Edges) -> Iterator[list[int]]:
    """Numbers of the edges of every run in which one follows the other."""
    number = len(edges.quarters)
    breaks = np.flatnonzero(~edges.follows)
    if len(breaks) == 0:
        # all round: a run may begin anywhere
        yield [k % number for k in range(min(2 * number - 1, 23))]
    for i, first in enumerate(breaks):
        length = int((breaks[(i + 1) % len(breaks)] - first - 1) % number) + 1
        yield [(int(first) + k) % number for k in range(min(length, 12))]


def _solved(
    edges: _Edges, run: list[int], matched: NDArray[np.intp], turned: int, usual: HMark, spread: Floats
) -> tuple[float, Floats] | None:
    """Misfit and (x, y, width, leg, stroke) of the run's match, joined by what other edges then fit."""
    quarters, places = (edges.quarters + turned) % 4, edges.places * 1.0
    # a quarter turn takes (x, y) to (-y, x)
    if turned:
        places = np.where(edges.quarters % 2 == 0, -places, places)
    pairs = dict(zip(run, (int(m) for m in matched), strict=True))
    solution = np.zeros(5)
    for _ in range(2):
        rows, right = [], []
        for i, j in pairs.items():
            along_x = QUARTERS[j] % 2 == 0
            weight = math.sqrt(edges.lengths[i])
            rows.append(weight * np.concatenate([[not along_x, along_x], PLACES[j]]))
            right.append(weight * places[i])
        scale = float(edges.lengths.max())
        ratios = (usual.width / usual.leg, usual.stroke / usual.leg)
        for k, ratio, std in ((2, ratios[0], spread[0]), (4, ratios[1], spread[1])):
            row = np.zeros(5)
            row[k], row[3] = 1.0, -ratio
            rows.append(row * 0.03 * math.sqrt(scale) / (std * ratio))
            right.append(0.0)
        solution, _, rank, _ = np.linalg.lstsq(np.array(rows, float), np.array(right, float), rcond=1e-9)
        if rank < 5:
            return None
        leg, width, stroke = solution[3], solution[2], solution[4]
        if not (leg > 0.0 and 0.4 < width / leg < 1.5 and 0.06 < stroke / leg < 0.4):
            return None
        expected = PLACES @ solution[2:] + np.where(QUARTERS % 2 == 0, solution[1], solution[0])
        for i in range(len(quarters)):
            alike = np.flatnonzero(quarters[i] == QUARTERS)
            j = int(alike[np.argmin(np.abs(expected[alike] - places[i]))])
            if abs(expected[j] - places[i]) < 0.06 * leg:
                pairs.setdefault(i, j)
    misfit = np.array([expected[j] - places[i] for i, j in pairs.items()])
    weights = np.array([edges.lengths[i] for i in pairs])
    unused = edges.lengths.sum() - weights.sum()
    rms = math.sqrt(float((weights * misfit**2).sum() / weights.sum())) / leg
    return (rms + 0.1 * float(unused / edges.lengths.sum()), solution) if rms < MISFIT else None


def _placed(solution: Floats, angle: float, turned: int, level: LevelAxes, true_leg: float) -> tuple[MarkPose, HMark]:
    """A solution on the unit plane as pose and mark."""
    x, y, width, leg, stroke = solution
    turn = angle - turned * math.pi / 2
    c, s = math.cos(turn), math.sin(turn)
    height = true_leg / float(leg)
    position = from_pad_plane(c * x - s * y, s * x + c * y, height, level)
    across = float(width * height)
    mark = HMark(true_leg, across, min(float(stroke * height), 0.42 * across))
    return MarkPose(position, -turn), mark
