"""Affine moment invariants, the template match and the thresholds before it."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimators.vision.contours import ShapeTemplate, Traced, candidates
from estimators.vision.moments import affine_invariants, central_moments, mismatch
from estimators.vision.threshold import modified_otsu, otsu
from flightlog.marks import HMark

H = HMark().outline()
SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
T = np.array([(0.4, 0), (0.6, 0), (0.6, 0.8), (1, 0.8), (1, 1), (0, 1), (0, 0.8), (0.4, 0.8)])
PLUS = np.array(
    [(0.4, 0), (0.6, 0), (0.6, 0.4), (1, 0.4), (1, 0.6), (0.6, 0.6), (0.6, 1), (0.4, 1), (0.4, 0.6), (0, 0.6),
     (0, 0.4), (0.4, 0.4)]
)  # fmt: skip
F = np.array(
    [(0, 0), (0.2, 0), (0.2, 0.4), (0.6, 0.4), (0.6, 0.6), (0.2, 0.6), (0.2, 0.8), (0.8, 0.8), (0.8, 1), (0, 1)]
)
RIGHT_TRIANGLE = np.array([(0, 0), (1, 0), (0, 1)], float)
I_BAR = np.array([(0.35, 0), (0.65, 0), (0.65, 1), (0.35, 1)])
DISC = 0.5 * np.column_stack([np.cos(np.linspace(0, 2 * np.pi, 120)), np.sin(np.linspace(0, 2 * np.pi, 120))])


def raster(outline: np.ndarray, size: float, map_: np.ndarray | None = None) -> np.ndarray:
    """Mask of an outline about `size` px large, after a linear map; pixel centres decide."""
    points = (outline - outline.mean(axis=0)) @ (np.eye(2) if map_ is None else map_).T * size
    points -= points.min(axis=0) - 3.0
    shape = np.ceil(points.max(axis=0)[::-1] + 4).astype(int)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    inside = np.zeros(shape, bool)
    for (xa, ya), (xb, yb) in zip(points, np.roll(points, -1, axis=0), strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            crosses = ((ya > y) != (yb > y)) & (x < xa + (y - ya) * (xb - xa) / (yb - ya))
        inside ^= crosses
    return inside.astype(np.uint8)


def invariants(outline: np.ndarray, size: float = 400.0, map_: np.ndarray | None = None) -> np.ndarray:
    return affine_invariants(central_moments(raster(outline, size, map_)))


def exact(rectangles: list[tuple[float, float, float, float]]) -> np.ndarray:
    """Central moments (5, 5) of a union of disjoint rectangles x0, y0, x1, y1, integrated in closed form."""

    def moment(p: int, q: int, cx: float, cy: float) -> float:
        return sum(
            ((x1 - cx) ** (p + 1) - (x0 - cx) ** (p + 1))
            / (p + 1)
            * ((y1 - cy) ** (q + 1) - (y0 - cy) ** (q + 1))
            / (q + 1)
            for x0, y0, x1, y1 in rectangles
        )

    area = moment(0, 0, 0, 0)
    cx, cy = moment(1, 0, 0, 0) / area, moment(0, 1, 0, 0) / area
    return np.array([[moment(p, q, cx, cy) for q in range(5)] for p in range(5)])


@pytest.mark.parametrize(
    ("outline", "rectangles"),
    [
        (H, [(0, 0, 0.2, 1), (0.8, 0, 1, 1), (0.2, 0.4, 0.8, 0.6)]),
        (SQUARE, [(0, 0, 1, 1)]),
        (T, [(0.4, 0, 0.6, 0.8), (0, 0.8, 1, 1)]),
        (F, [(0, 0, 0.2, 1), (0.2, 0.4, 0.6, 0.6), (0.2, 0.8, 0.8, 1)]),
    ],
)
def test_invariants_of_a_raster_are_those_of_the_shape(
    outline: np.ndarray, rectangles: list[tuple[float, float, float, float]]
) -> None:
    np.testing.assert_allclose(invariants(outline), affine_invariants(exact(rectangles)), rtol=0.02, atol=2e-9)


def test_first_invariant_of_known_shapes() -> None:
    for outline, value in ((H, 0.031804), (SQUARE, 1 / 144), (DISC, 1 / (16 * np.pi**2)), (RIGHT_TRIANGLE, 1 / 108)):
        assert invariants(outline)[0] == pytest.approx(value, rel=0.01)


def test_moments_agree_with_opencv_up_to_third_order() -> None:
    mask = raster(F, 90.0, np.array([[1.0, 0.3], [-0.2, 0.8]]))
    reference = cv2.moments(mask, binaryImage=True)
    u = central_moments(mask)
    for p, q in [(2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)]:
        assert u[p, q] == pytest.approx(reference[f"mu{p}{q}"], rel=1e-4, abs=1e-5 * u[0, 0] ** 2)


@settings(max_examples=15, deadline=None)
@given(st.floats(0, 6.28), st.floats(0.6, 1.6), st.floats(-0.5, 0.5))
def test_corrected_i3_is_affine_invariant_and_the_printed_one_is_not(turn: float, stretch: float, shear: float) -> None:
    c, s = np.cos(turn), np.sin(turn)
    map_ = np.array([[c, -s], [s, c]]) @ np.array([[stretch, shear], [0.0, 1.0]])
    np.testing.assert_allclose(invariants(F, 300, map_), invariants(F, 300), rtol=0.06, atol=1e-8)
    u = central_moments(raster(F, 300, map_))
    printed = u[2, 0] * (u[2, 1] * u[0, 3] - u[1, 2] ** 2) - u[1, 1] * (u[3, 0] * u[0, 3] - u[2, 1])
    printed = (printed + u[0, 2] * (u[3, 0] * u[1, 2] - u[2, 1] ** 2)) / u[0, 0] ** 7
    if abs(u[1, 1] * u[2, 1] * u[1, 2] / u[0, 0] ** 7) > 1e-5:
        assert abs(printed - invariants(F, 300)[2]) > 5e-6


def test_an_h_of_ninety_pixels_matches_itself_at_any_heading_and_no_other_letter() -> None:
    template = ShapeTemplate.of(H)
    own = []
    for heading in np.linspace(0.0, np.pi, 25):
        c, s = np.cos(heading), np.sin(heading)
        own.append(mismatch(invariants(H, 95.0, np.array([[c, -s], [0.857 * s, 0.857 * c]])), template.invariants))
    others = [mismatch(invariants(shape, 95.0), template.invariants) for shape in (SQUARE, DISC, PLUS, T, I_BAR, F)]
    assert max(own) < 0.15
    assert min(others) > 0.7


def test_without_a_floor_the_vanishing_invariants_would_decide() -> None:
    """I2 and I3 of an H are rounding noise: their logarithms alone scatter by decades."""
    rng = np.random.default_rng(0)
    values = []
    for heading in rng.uniform(0, np.pi, 30):
        c, s = np.cos(heading), np.sin(heading)
        values.append(invariants(H, 95.0, np.array([[c, -s], [s, c]])))
    logs = np.log10(np.abs(np.array(values)) + 1e-300)
    assert logs[:, 1].std() > 1.0
    assert logs[:, 0].std() < 0.02


def test_candidates_take_the_h_and_leave_the_rest() -> None:
    scene = np.zeros((300, 640), np.uint8)
    for i, shape in enumerate((H, SQUARE, T, PLUS)):
        mask = raster(shape, 100.0)
        scene[60 : 60 + mask.shape[0], 20 + 150 * i : 20 + 150 * i + mask.shape[1]] = mask * 255
    found = candidates(Traced.of(scene), ShapeTemplate.of(H), area=(1000, 20000), worst=0.4, solidity_margin=0.15)
    assert len(found) == 1
    assert found[0].box[0] < 30 and found[0].mismatch < 0.15


def blob(share: float, noise: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    side = round(np.sqrt(share) * 400)
    truth = np.zeros((400, 400), bool)
    truth[50 : 50 + side, 60 : 60 + side] = True
    grey = np.where(truth, 200.0, 80.0) + rng.normal(0, noise, truth.shape)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8), truth


def overlap(mask: np.ndarray, truth: np.ndarray) -> float:
    return float((mask & truth).sum() / (mask | truth).sum())


def test_modified_otsu_loses_a_small_pad_and_splits_a_large_one_where_plain_otsu_is_right() -> None:
    """Why the front end tries Otsu in a region of interest first."""
    grey, truth = blob(0.01, 5.0, np.random.default_rng(1))
    printed = modified_otsu(grey, "printed")
    assert printed is not None
    assert overlap(grey > printed, truth) < 0.2
    assert overlap(grey > otsu(grey), truth) > 0.97
    region = (slice(40, 110), slice(50, 120))
    # the mean lies above all of the ground: only the mark's own noise is left to be parted
    inside = modified_otsu(grey[region], "open")
    assert inside is not None
    assert overlap(grey[region] > inside, truth[region]) < 0.7
    assert overlap(grey[region] > otsu(grey[region]), truth[region]) > 0.97


def test_modified_otsu_maximises_its_own_criterion() -> None:
    """Against equations written out pixel by pixel."""
    grey, _ = blob(0.3, 12.0, np.random.default_rng(2))
    f = grey.astype(float).ravel()
    t0 = f.mean()
    t1 = f[f > t0].mean()
    for variant in ("printed", "open"):
        best, chosen = -1.0, None
        for t in range(int(np.floor(t0)) + 1, int(np.ceil(t1))):
            low = f[(f > t0) & (f <= t)]
            high = f[(f > t) & (f <= t1)] if variant == "printed" else f[f > t]
            if not len(low) or not len(high):
                continue
            g = len(low) * len(high) / len(f) ** 2 * (low.mean() - high.mean()) ** 2
            if g > best:
                best, chosen = g, t
        assert modified_otsu(grey, variant) == chosen  # type: ignore[arg-type]


def test_a_flat_picture_has_no_threshold() -> None:
    assert modified_otsu(np.full((20, 20), 77, np.uint8), "open") is None
