"""The landing as an environment: as dm_env wants it, without truth in what is seen, and fit to land in."""

import math

import dm_env
import numpy as np
import pytest
from absl.testing import absltest
from dm_env import test_utils

from scenarios.crew import make_pilot
from scenarios.landing_env import make
from scenarios.load import load

SHORT = load("landing", {"duration_s": 0.4})


class TestConformance(test_utils.EnvironmentTestMixin, absltest.TestCase):
    """dm_env's own tests."""

    def make_object_under_test(self):
        return make(SHORT, seed=1, steps=5)

    def make_action_sequence(self):
        spec = self.environment.action_spec()
        for k in range(30):
            yield spec.minimum + (0.4 + 0.1 * math.sin(k)) * (spec.maximum - spec.minimum)


@pytest.fixture
def env():
    with make(SHORT, seed=1) as environment:
        yield environment


def hold(environment, steps):
    """Fly at trim."""
    action = np.array(environment.physics.world.trim.controls)
    return [environment.step(action) for _ in range(steps)]


def test_an_episode_ends_when_time_is_up(env):
    first = env.reset()
    assert first.first() and first.reward is None
    steps = hold(env, 20)
    assert [step.last() for step in steps] == [False] * 19 + [True]
    assert steps[-1].discount == 1.0  # time is up: no failure
    assert env.physics.time() == pytest.approx(0.404)


def test_observations_are_finite_and_fit_their_specification(env):
    env.reset()
    spec = env.observation_spec()
    for step in hold(env, 10):
        assert set(step.observation) == set(spec)
        for name, value in step.observation.items():
            spec[name].validate(value)
            assert np.isfinite(value).all(), name
        assert math.isfinite(step.reward)


def test_actions_are_the_controls_within_the_servos_stops(env, raptor_servo):
    env.reset()
    spec = env.action_spec()
    assert spec.name == "collective,lateral,longitudinal,tail,throttle"
    assert spec.minimum[0] == raptor_servo["collective_min"] and spec.maximum[0] == raptor_servo["collective_max"]
    action = np.array([0.08, 0.01, -0.01, 0.02, 0.3])
    env.step(action)
    assert tuple(env.physics.world.controls) == tuple(action)


@pytest.fixture(scope="module")
def raptor_servo():
    from sim import vehicle as vehicles

    return vehicles.load("raptor90").parameters["servo"]


def test_episodes_differ_and_come_again_with_the_seed():
    def starts(seed):
        with make(SHORT, seed=seed) as environment:
            found = []
            for _ in range(3):
                first = environment.reset()
                last = hold(environment, 5)[-1]
                found.append((first.observation["position"].tolist(), last.observation["position"].tolist()))
            return found

    once, again, other = starts(7), starts(7), starts(8)
    assert once == again
    assert len({str(start) for start in once}) == 3
    assert once[0] != other[0]


def test_what_is_seen_holds_no_truth(noise):
    def seen(scramble):
        found = []
        with make(SHORT, seed=3) as environment:
            environment.reset()
            physics, task = environment.physics, environment.task
            if scramble:
                update, observe = physics.navigator.update, task.get_observation

                def blind_update(measurements):
                    with noise(physics.world):
                        return update(measurements)

                def blind_observe(physics):
                    with noise(physics.world):
                        return observe(physics)

                physics.navigator.update, task.get_observation = blind_update, blind_observe
            for step in hold(environment, 15):
                found.append(np.concatenate([np.ravel(value) for value in step.observation.values()]))
        return np.array(found)

    assert np.array_equal(seen(False), seen(True))


def test_a_pilot_lands_through_the_environment():
    scenario = load("landing", {"weather.wind_m_s": 1.0})
    with make(scenario, seed=2, steps=1) as environment:
        step = environment.reset()
        physics = environment.physics
        pilot = make_pilot(physics.vehicle, physics.world.site, scenario, physics.world.trim.heading)
        controls = physics.world.trim.controls
        while not step.last():
            if physics.time() >= 0.5:
                controls = pilot.update(physics.state)
            step = environment.step(np.array(controls))
        assert physics.world.contact.count
        assert step.reward > 5.0 and step.discount == 0.0  # a soft touchdown near the centre
        assert physics.time() < 60.0


def test_a_crash_is_worse_and_nan_ends_the_episode(env):
    env.reset()
    bad = env.step(np.full(5, np.nan))
    assert bad.last() and bad.discount == 0.0 and bad.reward == -10.0
    assert isinstance(env.reset(), dm_env.TimeStep)
    low = load("landing", {"start.position_m": [0.0, 0.0, 2.0], "start.heading_deg": 0.0})
    with make(low, seed=1) as environment:
        step = environment.reset()
        while not step.last():
            step = environment.step(environment.action_spec().minimum)  # collective down, throttle shut
        assert step.reward < -5.0 and step.discount == 0.0
