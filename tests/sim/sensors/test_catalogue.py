"""What holds for every sensor."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim.sensors import CATALOGUE

TOPICS = list(CATALOGUE)


def moving(t, truth):
    return truth(
        t, position=(0.3 * math.sin(t), 0.2, 1.5 + 0.5 * math.sin(0.7 * t)), roll=0.05 * math.sin(2 * t), heading=0.3
    )


@pytest.mark.parametrize("topic", TOPICS)
def test_the_vehicle_file_fits_it_with_every_number_in_range(bench, topic):
    numbers = bench.numbers(topic)
    for parameter in CATALOGUE[topic].PARAMETERS:
        assert parameter.low <= numbers[parameter.name] <= parameter.high, parameter.name
        assert "(" not in parameter.scenario_key, "a key that TOML takes unquoted"


@pytest.mark.parametrize("topic", TOPICS)
def test_same_seed_same_samples_and_another_seed_others(bench, truth, topic):
    first, again, other = (
        repr(list(bench.run(bench.build(topic, seed), 60, lambda t: moving(t, truth)))) for seed in (3, 3, 4)
    )
    assert first == again
    assert first != other


@pytest.mark.parametrize("topic", TOPICS)
def test_truth_is_left_as_it_was(bench, truth, topic):
    given = truth(0.0, position=(0.1, 0.2, 1.5), roll=0.1)
    before = replace(given, **{n: getattr(given, n).copy() for n in ("position", "velocity", "rotation", "rates")})
    bench.build(topic).sample(given)
    for name in ("position", "velocity", "rotation", "rates"):
        np.testing.assert_array_equal(getattr(given, name), getattr(before, name))


@pytest.mark.parametrize("topic", TOPICS)
def test_errors_are_named_one_by_one(bench, topic):
    sensor = bench.build(topic)
    *_, sample = bench.rest(sensor, 2)
    assert len(sensor.errors()) == len(sensor.ERRORS)
    assert all(type(error) is float for error in sensor.errors())
    assert all(type(value) in (float, bool, int, str) for value in sample)


@pytest.mark.parametrize("topic", TOPICS)
def test_a_number_that_it_does_not_have_is_refused(bench, topic):
    with pytest.raises(KeyError, match="typo"):
        bench.build(topic, typo=1.0)
    with pytest.raises(KeyError, match="typo"):
        bench.build(topic).numbers.update(typo=1.0)


# a number changed in flight, by topic, and the field that must follow it
CHANGES = {
    "imu": ("bias_fx", 3.0, "fx", 3.0),
    "mag": ("bias_y", 5.0, "my", 5.0),
    "baro": ("bias", 20.0, "altitude", 20.0),
    "gps": ("bias_u", 30.0, "u", 30.0),
    "sonar": ("scale", 2.0, "range", 1.4),
    "rotor": ("scale", 1.5, "speed", 78.5),
    "pad": ("scale", 1.5, "z", 0.75),
    "flow": ("bias_u", 0.01, "u", 0.01),
}


@pytest.mark.parametrize("topic", TOPICS)
def test_a_number_changed_in_flight_acts_at_the_next_sample(bench, topic):
    name, value, field, shift = CHANGES[topic]
    start = {"position": (0.0, 0.0, 1.4 if topic == "sonar" else 1.6)}
    one, other = (bench.build(topic, 1, perfect=True) for _ in range(2))
    for sensor in (one, other):
        if topic == "flow":
            sensor.numbers.update(detection_share=1.0)
    if topic == "pad":
        for sensor in (one, other):
            sensor.numbers.update(edge_noise=1e-3, tilt_std=1e-5, bleed_std=1e-3, detection_share=1.0)
            sensor.numbers.update(cut_detection_share=1.0, predicted_std=0.01, predicted_angle_std=0.01)
    for _ in bench.rest(one, 10, **start):
        pass
    for _ in bench.rest(other, 10, **start):
        pass
    other.numbers.update({name: value})
    *_, plain = bench.rest(one, 3, **start)
    *_, changed = bench.rest(other, 3, **start)
    assert getattr(changed, field) - getattr(plain, field) == pytest.approx(shift, rel=0.03)
