"""The ranger: geometry by closed form, reach, false echoes, dropouts."""

import math

import numpy as np
import pytest


def test_level_it_measures_the_height_of_its_mount(bench):
    sonar = bench.build("sonar", perfect=True)
    for height in (0.23, 1.0, 3.0):
        (sample,) = bench.rest(sonar, 1, position=(0, 0, height))
        assert sample == (0.0, pytest.approx(height - 0.03), True)


@pytest.mark.parametrize("tilt", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("axis", ["roll", "pitch"])
def test_tilted_it_measures_the_nearest_ground_in_the_beam(bench, tilt, axis):
    half = math.radians(10)
    mount = np.array([0.08, 0.0, -0.03])
    sonar = bench.build("sonar", perfect=True, beam_half_angle=half, position=mount)
    (sample,) = bench.rest(sonar, 1, position=(0, 0, 1.5), **{axis: tilt})
    # by search over the beam's directions in the plane of the tilt
    beams = tilt + np.linspace(-half, half, 100_001)
    height = 1.5 - 0.03 * math.cos(tilt) + (0.08 * math.sin(tilt) if axis == "pitch" else 0.0)
    assert sample.range == pytest.approx(np.min(height / np.cos(beams)), rel=1e-9)


def test_noise_and_steps_as_declared(bench):
    n = bench.numbers("sonar")
    sonar = bench.build("sonar", 1, scale_std=0.0, dropout_share=0.0)
    x = np.array([s.range for s in bench.rest(sonar, 8000, position=(0, 0, 2.53))])
    steps = x / n["resolution"]
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    expected = math.hypot(2.5 * n["noise_share"], n["resolution"] / math.sqrt(12))
    assert x.std() == pytest.approx(expected, rel=0.05)
    assert x.mean() == pytest.approx(2.5, abs=2e-4)


def test_scale_is_drawn_per_flight(bench):
    n = bench.numbers("sonar")
    ranges = [
        next(bench.rest(bench.build("sonar", seed, perfect=True, scale_std=n["scale_std"]), 1, position=(0, 0, 2.03)))
        for seed in range(600)
    ]
    assert np.std([s.range for s in ranges]) == pytest.approx(2.0 * n["scale_std"], rel=0.12)


def test_out_of_reach_there_are_false_echoes_at_the_declared_share_and_else_none(bench):
    n = bench.numbers("sonar")
    samples = list(bench.rest(bench.build("sonar", 2), 20_000, position=(0, 0, 10.0)))
    false = [s for s in samples if s.valid]
    share = n["false_echo_share"]
    assert len(false) / len(samples) == pytest.approx(share, abs=4 * math.sqrt(share * (1 - share) / len(samples)))
    assert all(math.isnan(s.range) for s in samples if not s.valid)
    ranges = np.array([s.range for s in false])
    least, greatest = n["least_range"], n["greatest_range"]
    assert ranges.min() >= least - 2e-3
    assert ranges.max() <= greatest + 2e-3
    # uniform: Kolmogorov-Smirnov at 0.1 %
    distance = np.abs(np.sort((ranges - least) / (greatest - least)) - np.linspace(0, 1, len(ranges))).max()
    assert distance < 1.95 / math.sqrt(len(ranges))


def test_within_reach_some_echoes_are_lost(bench):
    n = bench.numbers("sonar")
    samples = list(bench.rest(bench.build("sonar", 3), 20_000, position=(0, 0, 1.0)))
    lost = np.mean([not s.valid for s in samples])
    assert lost == pytest.approx(n["dropout_share"], abs=4 * math.sqrt(n["dropout_share"] / len(samples)))


def test_too_near_or_upside_down_there_is_no_echo(bench):
    sonar = bench.build("sonar", perfect=True)
    (near,) = bench.rest(sonar, 1, position=(0, 0, 0.1))
    (over,) = bench.rest(sonar, 1, position=(0, 0, 1.0), roll=3.0)
    assert not near.valid
    assert not over.valid


def test_a_false_echo_is_told_in_the_true_fault_states(bench, truth):
    sonar = bench.build("sonar", 4, false_echo_share=0.5)
    for k in range(50):
        sample = sonar.sample(truth(0.05 * k))
        assert sonar.errors()[1] == float(sample.valid)
