"""Lei 2012's desk and stairs: bounds, benches and figures on few pictures."""

import math

import numpy as np
import pytest

from flightlog.marks import HMark
from flightlog.rotations import matrix, quaternion
from scenarios.experiments import lei2012_desk, lei2012_stairs, stairs_bench
from scenarios.experiments.lei_readings import PUBLISHED, READINGS
from scenarios.experiments.still_camera import CAMERA, MOUNT, Stand, edge_noise, height_bound, stand

HEIGHTS = stairs_bench.HEIGHTS


def level_stand(height: float) -> Stand:
    return Stand(np.array([0.0, 0.0, height]), quaternion(0.0, 0.0, 0.0))


def test_the_bound_of_height_is_that_of_the_scale_of_an_outline() -> None:
    """Closed form: an edge L long, a n from the centre, moves by f a n/h^2 a metre and has L f'/h points."""
    height = 10.0
    information = 0.0
    outline = HMark().outline()
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        length = np.linalg.norm(b - a)
        away = float(a @ [b[1] - a[1], a[0] - b[0]]) / length  # the same all along an edge
        across, along = (CAMERA.fx, CAMERA.fy) if a[0] == b[0] else (CAMERA.fy, CAMERA.fx)
        information += length * along / height * (across * away / height**2) ** 2
    assert height_bound(HMark(), level_stand(height), 0.1) == pytest.approx(0.1 / math.sqrt(information), rel=1e-3)


def test_the_bound_grows_with_the_power_two_and_a_half_of_the_height() -> None:
    near, far = (height_bound(HMark(), level_stand(h), 0.1) for h in (4.0, 16.0))
    assert far / near == pytest.approx(4**2.5, rel=0.01)


def test_a_stand_has_the_mark_near_the_optical_axis_whatever_its_tilt() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        where = stand(rng, 7.0, tilt=0.1, stray=0.01, turn=math.pi)
        assert where.position[2] == 7.0
        assert np.abs(where.to_mark[:2]).max() < 0.011 * 7.0 * 1.2
        north = matrix(where.attitude) @ MOUNT.axes
        assert np.allclose(north @ where.to_mark, -where.position)


def test_the_instruments_err_as_the_paper_says() -> None:
    """Mean errors and deviations of figure 6, all four landings together."""
    gps, baro = [], []
    for landing, height in enumerate(HEIGHTS):
        rng = np.random.default_rng([20120436, landing])
        _, g, _, b = stairs_bench._instruments(height, landing, 60.0, rng)
        gps.append(g - height)
        baro.append(b - height)
    for errors, mean, deviation in ((gps, 0.760, 0.165), (baro, 0.175, 0.092)):
        together = np.concatenate(errors)
        assert np.abs(together).mean() == pytest.approx(mean, rel=0.1)
        assert together.std() == pytest.approx(deviation, rel=0.2)
    assert np.abs(np.concatenate(gps)).max() == pytest.approx(1.49, abs=0.1)


def minute(height: float, gps: float, vision: float, seconds: float = 20.0) -> stairs_bench.Minute:
    """Made-up measurements without noise."""
    t_gps, t_baro, t = (np.arange(0.0, seconds, step) for step in (0.2, 0.1, 0.4))
    seen = np.full(len(t), height + vision)
    return stairs_bench.Minute(
        height, t_gps, np.full(len(t_gps), height + gps), t_baro, np.full(len(t_baro), height + 0.1), t,
        np.tile(seen[:, None], (1, len(READINGS))), seen, np.full(len(t), 0.01**2), seen, np.full(len(t), 0.01**2),
        0.001, np.zeros((4, 4), np.uint8),
    )  # fmt: skip


def test_the_published_filter_believes_a_biased_gps_and_ours_does_not() -> None:
    m = minute(10.0, 0.76, 0.0)
    _, white = lei2012_stairs.published_fusion(m, m.published[:, PUBLISHED], lei2012_stairs.WHITE)
    assert white[-1] - 10.0 > 0.4
    _, told = lei2012_stairs.published_fusion(m, m.published[:, PUBLISHED])
    assert 0.0 < told[-1] - 10.0 < 0.25
    _, ours, std = lei2012_stairs.our_fusion(m, m.ours, m.ours_variance)
    assert abs(ours[-1] - 10.0) < 0.02
    assert std[-1] < 0.03


def test_without_vision_ours_and_the_published_filter_go_on() -> None:
    m = minute(10.0, 0.3, np.nan)
    _, blind = lei2012_stairs.published_fusion(m, None)
    _, ours, std = lei2012_stairs.our_fusion(m, m.ours, m.ours_variance)
    assert abs(blind[-1] - 10.0) < 0.5
    assert abs(ours[-1] - 10.0) < 3.0 * std[-1]


@pytest.mark.render
def test_the_desk_and_its_bars() -> None:
    answer = lei2012_desk.measure(0, 1)
    outcome = lei2012_desk.conclude("quick", [answer])
    mean, largest, found = outcome.figures
    assert mean.reached and largest.reached and found.reached
    assert mean.faithful is not None and mean.ours is not None
    assert 0.3 < mean.faithful < 5.0
    assert mean.bound is not None and 0.3 * mean.bound < mean.ours < 4.0 * mean.bound
    assert edge_noise(lei2012_desk.INDOORS) == pytest.approx(0.025, abs=0.01)


@pytest.mark.render
def test_a_landing_of_the_stairs_and_its_bars() -> None:
    m = stairs_bench.minute(1, 4.0)
    assert np.isfinite(m.published[:, PUBLISHED]).all() and np.isfinite(m.exact).all()
    errors = 1e3 * (m.exact - m.height)
    assert np.sqrt(np.mean(errors**2)) < 2.0
    assert np.sqrt(np.mean((m.ours - m.height) ** 2)) < 0.04
    assert 0.02 < np.abs(m.published[:, PUBLISHED] - m.height).mean() < 1.0
    outcome = lei2012_stairs.conclude("quick", [m])
    by_name = {figure.quantity: figure for figure in outcome.figures}
    assert by_name["fused: mean |error|"].reached
