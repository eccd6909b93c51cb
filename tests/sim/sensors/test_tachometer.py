"""The tachometer: steady, slowing and standing rotors."""

import math

import numpy as np
import pytest


def test_steady_speed_is_measured_within_the_timers_resolution(bench):
    tachometer = bench.build("rotor", noise_share=0.0)
    speed = np.array([s.speed for s in bench.rest(tachometer, 500, rotor_speed=157.08)])
    # two stamps of 4 us in 20 ms less a pulse
    assert np.abs(speed / 157.08 - 1.0).max() < 4e-6 / 0.017
    assert speed.std() > 0.0  # quantised


def test_noise_as_declared(bench):
    share = bench.numbers("rotor")["noise_share"]
    speed = np.array([s.speed for s in bench.rest(bench.build("rotor", 1, timer=0.0), 5000, rotor_speed=150.0)])
    assert speed.std() == pytest.approx(150.0 * share, rel=0.05)


def test_a_slowing_rotor_is_read_about_half_a_period_late(bench, truth):
    tachometer = bench.build("rotor", perfect=True)
    slope = -40.0
    samples = list(bench.run(tachometer, 100, lambda t: truth(t, rotor_speed=157.0 + slope * t)))[2:]
    late = np.array([(s.speed - (157.0 + slope * s.t)) / -slope for s in samples])
    assert 0.008 < late.mean() < 0.014


def test_a_standing_rotor_reads_zero_after_the_timeout_and_never_less(bench, truth):
    tachometer = bench.build("rotor", perfect=True, timeout=0.5)

    def stopping(t):
        return truth(t, rotor_speed=max(0.0, 30.0 - 30.0 * t))

    samples = list(bench.run(tachometer, 100, stopping))
    speed = np.array([s.speed for s in samples])
    assert np.all(speed >= 0.0)
    assert np.all(np.diff(speed) <= 1e-9)
    assert np.all(speed[80:] == 0.0)
    assert speed[:40] == pytest.approx([30.0 - 30.0 * s.t for s in samples[:40]], abs=2.0)  # a pulse or two late


def test_no_pulse_since_bounds_the_speed(bench, truth):
    tachometer = bench.build("rotor", perfect=True, pulses=1.0, timeout=10.0)
    for k in range(10):
        tachometer.sample(truth(0.02 * k, rotor_speed=157.0))
    sample = tachometer.sample(truth(1.18, rotor_speed=0.0))
    later = tachometer.sample(truth(2.18, rotor_speed=0.0))
    assert later.speed < sample.speed or later.speed == pytest.approx(2 * math.pi / 2.0, rel=0.1)


def test_silence_does_not_make_the_rotor_slow(bench, truth):
    tachometer = bench.build("rotor", perfect=True)
    for k in range(10):
        tachometer.sample(truth(0.02 * k, rotor_speed=157.0))
    assert tachometer.sample(truth(5.2, rotor_speed=157.0)).speed == pytest.approx(157.0, rel=1e-3)
