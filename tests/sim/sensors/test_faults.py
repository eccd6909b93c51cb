"""Faults laid on a sensor from outside."""

import math

import numpy as np
import pytest

from flightlog.signals import GpsSample, SonarSample
from sim.sensors import faults

RNG = np.random.default_rng(0)


def sonar(t, value=2.0):
    return SonarSample(t, value, True)


def through(fault, times, value=lambda t: 2.0, seed=0):
    rng = np.random.default_rng(seed)
    return [fault.apply(sonar(t, value(t)), t, rng) for t in times]


def test_stuck_holds_the_value_of_its_first_sample_and_lets_go(request):
    fault = faults.Stuck(topic="sonar", column="range", start=1.0, end=2.0)
    ranges = [s.range for s in through(fault, np.arange(0.0, 3.0, 0.25), value=lambda t: 10.0 + t)]
    assert ranges == [10.0, 10.25, 10.5, 10.75, 11.0, 11.0, 11.0, 11.0, 12.0, 12.25, 12.5, 12.75]
    # a second span begins anew
    again = [s.range for s in through(fault, [0.0, 1.5, 1.75], value=lambda t: t)]
    assert again == [0.0, 1.5, 1.5]


def test_offset_and_ramp_act_in_their_span_alone():
    offset = faults.Offset(topic="sonar", column="range", size=-0.5, start=1.0, end=2.0)
    assert [s.range for s in through(offset, [0.9, 1.0, 1.9, 2.0])] == [2.0, 1.5, 1.5, 2.0]
    ramp = faults.Ramp(topic="sonar", column="range", size=0.1, start=1.0, end=2.0)
    assert [s.range for s in through(ramp, [0.9, 1.0, 1.5, 2.0])] == pytest.approx([2.0, 2.0, 2.05, 2.0])


def test_spikes_come_at_their_share_within_their_size():
    fault = faults.Spike(topic="sonar", column="range", size=5.0, share=0.1)
    off = np.array([s.range for s in through(fault, np.arange(20_000.0))]) - 2.0
    hit = off != 0.0
    assert hit.mean() == pytest.approx(0.1, abs=4 * math.sqrt(0.09 / 20_000))
    assert 4.5 < np.abs(off[hit]).max() <= 5.0
    assert off[hit].std() == pytest.approx(5.0 / math.sqrt(3), rel=0.05)


def test_dropout_swallows_its_share():
    assert through(faults.Dropout(topic="sonar", start=1.0, end=2.0), [0.5, 1.5, 2.5]) == [sonar(0.5), None, sonar(2.5)]
    kept = [s for s in through(faults.Dropout(topic="sonar", share=0.3), np.arange(10_000.0)) if s is not None]
    assert len(kept) / 10_000 == pytest.approx(0.7, abs=0.02)


def test_a_clock_ahead_moves_both_stamps():
    fix = GpsSample(1.0, 1.2, 0, 0, 0, 0, 0, 0, 9, 1.0, True)
    moved = faults.ClockOffset(topic="gps", delay=0.1).apply(fix, 1.0, RNG)
    assert (moved.t, moved.t_arrival) == pytest.approx((1.1, 1.3))
    assert faults.ClockOffset(topic="sonar", delay=0.1).apply(sonar(1.0), 1.0, RNG).t == pytest.approx(1.1)


def test_a_missing_echo_stays_missing():
    lost = SonarSample(1.0, math.nan, False)
    changed = faults.Offset(topic="sonar", column="range", size=1.0).apply(lost, 1.0, RNG)
    assert math.isnan(changed.range)
    assert not changed.valid


@pytest.mark.parametrize("kind", faults.COLUMN_FAULTS)
def test_faults_are_built_by_their_kind(kind):
    fault = faults.column_fault(kind, "sonar", "range", start=1.0, end=3.0, size=0.7, share=1.0)
    assert type(fault) is faults.COLUMN_FAULTS[kind]
    before, first, last, after = through(fault, [0.5, 1.0, 2.0, 3.0], value=lambda t: 2.0 + t)
    assert before == sonar(0.5, 2.5)
    assert last.range != 4.0
    assert after == sonar(3.0, 5.0)
    assert first is not None


def test_a_column_that_the_topic_does_not_have_is_an_error():
    with pytest.raises(AttributeError):
        faults.Offset(topic="sonar", column="rnage", size=1.0).apply(sonar(0.0), 0.0, RNG)
