"""The horizon levels the attitude, at the time of its picture, and as far as it says."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from estimators.navigator import Navigator
from flightlog.constants import EARTH_RADIUS
from flightlog.equipment import Equipment
from flightlog.signals import GpsSample, HorizonSample, ImuSample, MagSample, PadSample

STD = math.radians(0.05)
MOUNT = math.radians(0.05)


def with_horizon(flight, seed: int, *, latency: float = 0.08, dip: float = 0.0, std: float = STD, mount: float = MOUNT):
    """The flight with ten sightings a second, white errors and a mount that is off for the whole flight."""
    rng = np.random.default_rng(seed)
    times = flight.t[::25]
    roll, pitch, _ = flight.motion.angles(times)
    off = mount * rng.standard_normal(2)
    updates = [list(update) for update in flight.updates]
    for t, r, p in zip(times.tolist(), roll, pitch, strict=True):
        i = round((t + latency) / 0.004)
        if i < len(updates):
            e = std * rng.standard_normal(2) + off
            updates[i].append(HorizonSample(t, t + latency, r + e[0], p + dip + e[1], std, std, True))
    return replace(flight, updates=updates)


def in_trouble(synthetic, seed: int, duration: float = 20.0):
    """Neither GPS nor mark nor magnetometer after 3 s, and two gyroscopes go wrong by ten of their deviations."""
    flight = synthetic.fly(seed, synthetic.Recipe(duration=duration))
    for kind in (GpsSample, PadSample, MagSample):
        flight = flight.drop(kind, begin=3.0)

    def biased(s: ImuSample) -> ImuSample:
        return s._replace(wx=s.wx + 0.003, wy=s.wy - 0.003) if s.t > 4.0 else s

    return flight.change(ImuSample, biased)


def tilt_errors(flight, equipment: Equipment, *, horizon: bool = True):
    """(N, 2) tilt errors and (N,) stated deviations [rad]; the navigator."""
    navigator = Navigator(equipment, horizon=horizon)
    states = [navigator.update(update) for update in flight.updates]
    roll, pitch, _ = flight.motion.angles(flight.t)
    errors = np.array([[s.roll, s.pitch] for s in states]) - np.column_stack([roll, pitch])
    return errors, np.array([s.std_attitude[0] for s in states]), navigator


def rms_deg(errors) -> float:
    return math.degrees(float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))))


def test_the_horizon_holds_what_gyroscopes_gps_and_mark_have_lost(synthetic, equipment: Equipment) -> None:
    flight = in_trouble(synthetic, 5)
    after = flight.t > 6.0
    held, _, _ = tilt_errors(with_horizon(flight, 1), equipment)
    lost, _, _ = tilt_errors(flight, equipment, horizon=False)
    assert rms_deg(held[after]) < 0.25
    assert rms_deg(lost[after]) > 3.0 * rms_deg(held[after])


def test_a_navigator_that_was_not_told_to_does_not_use_it(synthetic, equipment: Equipment) -> None:
    flight = synthetic.fly(6, synthetic.Recipe(duration=4.0))
    without, _, _ = tilt_errors(flight, equipment, horizon=False)
    given, _, _ = tilt_errors(with_horizon(flight, 2), equipment, horizon=False)
    np.testing.assert_array_equal(without, given)


@pytest.mark.parametrize("latency", [0.0, 0.3])
def test_a_late_sighting_is_as_good_as_a_prompt_one(synthetic, equipment: Equipment, latency: float) -> None:
    """Rolling by 10 deg/s, a picture taken for one of now would be off by 3 deg."""
    flight = synthetic.fly(7, synthetic.Recipe(duration=12.0, sway=6.0))
    for kind in (GpsSample, PadSample):
        flight = flight.drop(kind)
    errors, _, _ = tilt_errors(with_horizon(flight, 3, latency=latency), equipment)
    roll = flight.motion.angles(flight.t)[0]
    assert np.degrees(np.abs(np.diff(roll)).max() / 0.004) > 5.0
    assert rms_deg(errors[flight.t > 3.0]) < 0.25


def test_the_stated_deviation_is_true(synthetic, equipment: Equipment) -> None:
    """Over flights with drawn biases and mounts: not too small by the 99.9 % bound, not four times too large."""
    scores = []
    for seed in range(12):
        flight = synthetic.fly(100 + seed, synthetic.Recipe(duration=8.0))
        for kind in (GpsSample, PadSample):
            flight = flight.drop(kind, begin=1.0)
        errors, stds, _ = tilt_errors(with_horizon(flight, seed), equipment)
        scores.append(np.sum(errors[-1] ** 2) / stds[-1] ** 2)
    assert np.sum(scores) < chi2.ppf(0.9995, 2 * len(scores))
    assert np.mean(scores) > 2.0 / 16.0


def test_the_dip_is_taken_off_where_there_is_one(synthetic, equipment: Equipment) -> None:
    dip = math.sqrt(2.0 * 100.0 / EARTH_RADIUS)
    flight = with_horizon(
        synthetic.fly(8, synthetic.Recipe(duration=8.0, height=100.0)).drop(PadSample), 4, dip=dip, mount=0.0
    )
    means = {}
    for dips in (True, False):
        errors, _, _ = tilt_errors(flight, replace(equipment, horizon_dips=dips))
        means[dips] = math.degrees(float(np.mean(errors[flight.t > 4.0, 1])))
    assert abs(means[True]) < 0.12
    assert means[False] - means[True] > 0.15  # of 0.32: the accelerometer has its say


def test_what_is_no_sighting_is_refused_and_counted(equipment: Equipment) -> None:
    navigator = Navigator(equipment, horizon=True)
    level = [ImuSample(0.004 * k, 0.0, 0.0, 9.80665, 0.0, 0.0, 0.0) for k in range(100)]
    for sample in level:
        navigator.update([sample])
    bad = [
        HorizonSample(0.2, 0.3, math.nan, 0.0, STD, STD, True), HorizonSample(0.24, 0.3, 0.0, 0.0, STD, STD, False),
        HorizonSample(0.28, 0.3, 0.0, 0.0, 0.0, STD, True), HorizonSample(9.0, 9.0, 0.0, 0.0, STD, STD, True),
    ]  # fmt: skip
    state = navigator.update([ImuSample(0.4, 0.0, 0.0, 9.80665, 0.0, 0.0, 0.0), *bad])
    assert navigator.rejected["horizon"] == len(bad)
    assert abs(state.roll) < 1e-3


def test_a_passing_false_horizon_does_not_tilt_the_attitude(synthetic, equipment: Equipment) -> None:
    flight = with_horizon(synthetic.fly(9, synthetic.Recipe(duration=8.0)), 5)

    def false(s: HorizonSample) -> HorizonSample:
        return s._replace(roll=s.roll + math.radians(20.0)) if 5.0 < s.t < 6.0 else s

    errors, _, navigator = tilt_errors(flight.change(HorizonSample, false), equipment)
    assert np.degrees(np.abs(errors[flight.t > 5.0])).max() < 0.25
    assert navigator.rejected["horizon"] >= 9
