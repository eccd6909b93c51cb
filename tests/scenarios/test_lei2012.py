"""Lei's filter in the loop, and the experiments' bookkeeping."""

import numpy as np
import pytest

from estimators.navigators.lei2012 import LeiNavigator
from scenarios.experiments import consistency, lei2012_hover, lei2012_landing
from scenarios.flight import fly
from scenarios.load import load


def test_the_published_filter_lands() -> None:
    seen = []
    flight = fly(
        load("landing", {"navigator": "lei2012", "variant": "published"}), seed=1, cameras=False,
        onlooker=lambda world, measurements, navigator, state: seen.append(type(navigator)),
    )  # fmt: skip
    assert set(seen) == {LeiNavigator}
    assert flight.summary.success
    # decimetres, not centimetres: it takes a GPS that is off for one that is noisy
    assert 0.03 < (flight.summary.fused_height_mean_error_m or 0.0) < 0.6


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_hover_s_sensors_are_as_bad_as_the_paper_s(sign: float) -> None:
    """The numbers put in, drawn many times, give the paper's mean and deviation."""
    rng = np.random.default_rng(0)
    t, n = np.arange(0.0, 60.0, 0.2), 400
    for (constant, wander), (mean, std) in zip((lei2012_hover.BARO, lei2012_hover.GPS),
                                              (lei2012_hover.PAPER["baro"], lei2012_hover.PAPER["gps"]),
                                              strict=True):  # fmt: skip
        decay = np.exp(-0.2 / lei2012_hover.WANDER_TAU)
        x = np.zeros((n, len(t)))
        x[:, 0] = wander * rng.standard_normal(n)
        for k in range(1, len(t)):
            x[:, k] = decay * x[:, k - 1] + wander * np.sqrt(1 - decay**2) * rng.standard_normal(n)
        error = sign * constant + x
        assert np.abs(error).mean() == pytest.approx(mean, rel=0.1)
        assert error.std(axis=1).mean() == pytest.approx(std, rel=0.2)


def test_equal_sets_of_landings_compare_as_equal_and_shifted_ones_do_not() -> None:
    rng = np.random.default_rng(1)
    names = list(lei2012_landing.COMPARED)

    def rows(mean: float, spread: float):
        return [dict.fromkeys(names, mean + spread * rng.standard_normal()) for _ in range(12)]

    same = lei2012_landing.compare(rows(0.03, 0.01), rows(0.03, 0.01))
    shifted = lei2012_landing.compare(rows(0.03, 0.01), rows(0.06, 0.01))
    wider = lei2012_landing.compare(rows(0.03, 0.01), rows(0.03, 0.08))
    assert all(row["same mean, p"] > 0.01 for row in same)
    assert all(row["same mean, p"] < 0.001 for row in shifted)
    assert all(row["same spread, p"] < 0.01 for row in wider)


def test_the_bands_are_those_of_the_tables() -> None:
    """Bar-Shalom's: fifty runs, 95 %."""
    assert consistency.band(1, 50, 0.95) == pytest.approx((0.647, 1.428), abs=2e-3)
    assert consistency.band(2, 50, 0.95) == pytest.approx((1.484, 2.591), abs=2e-3)
    assert consistency.band(9, 50, 0.999) == pytest.approx((7.156, 11.106), abs=5e-3)


def test_ours_is_consistent_where_lei_s_is_not() -> None:
    found = consistency.fly_some("everything aboard", (0, 1, 2, 3))
    for name, degrees in consistency.DEGREES.items():
        mean = np.mean([one.nees[name].mean() for one in found])
        low, high = consistency.band(degrees, len(found), 0.9999)
        assert (low < mean < high) == (name != consistency.PUBLISHED), (name, mean)
