import control as ct
import numpy as np
import pytest

from flightlog.signals import Controls
from sim.terms.servo import LONGEST_DELAY


def respond(pipeline, commands, dt, name="lateral"):
    """The control at the swash plate for a command each tick."""
    s = pipeline.signals()
    out = []
    for command in commands:
        for control in Controls._fields:
            s[control] = 0.0
        s[name] = command
        pipeline.run(s, dt)
        out.append(float(s[name]))
    return np.array(out)


@pytest.fixture
def servo(model):
    def build(**numbers):
        pipeline = model("servo")
        for name, value in numbers.items():
            pipeline.set_parameter("servo", name, value)
        return pipeline

    return build


@pytest.mark.parametrize("dt", [0.0005, 0.001, 0.0015, 0.002, 0.004, 0.01, 0.05])
@pytest.mark.parametrize("delay", [0.0, 0.0033, 0.02, 0.047, LONGEST_DELAY])
def test_the_delay_is_pure_and_exact_for_any_tick(servo, dt, delay):
    pipeline = servo(delay=delay, tau=0.0, rate_limit=100.0)
    t = np.arange(int(0.5 / dt)) * dt
    ramp = 0.1 * t  # linear interpolation reproduces a ramp
    late = respond(pipeline, ramp, dt)
    settled = t > delay + 2.0 * max(dt, 0.002)
    np.testing.assert_allclose(late[settled], 0.1 * (t[settled] - delay), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "delay"), [("collective", "delay"), ("tail", "delay"), ("throttle", "throttle_delay")]
)
def test_every_control_is_late(servo, name, delay):
    taus = {"tau": 0.0, "throttle_tau": 0.0, "rate_limit": 100.0}
    pipeline = servo(**taus, **{delay: 0.03})
    step = respond(pipeline, [0.0] + [0.1] * 30, 0.002, name)
    assert np.flatnonzero(step > 0.0)[0] == 16
    assert step[-1] == pytest.approx(0.1)


def test_the_lag_is_first_order(servo):
    pipeline = servo(delay=0.0, tau=0.026, rate_limit=100.0)
    out = respond(pipeline, [0.0] + [0.05] * 60, 0.002)
    t = np.arange(61) * 0.002
    np.testing.assert_allclose(out, 0.05 * (1.0 - np.exp(-t / 0.026)), atol=1e-12)


@pytest.mark.parametrize("second", [0.1, 0.3, 0.499])
def test_a_second_stage_makes_the_lag_of_second_order(servo, second):
    tau, dt = 0.05, 0.0005
    pipeline = servo(delay=0.0, tau=tau, second=second, rate_limit=100.0)
    out = respond(pipeline, [0.0] + [0.05] * 800, dt)
    t = np.arange(801) * dt
    plant = ct.tf([1.0], np.polymul([(1.0 - second) * tau, 1.0], [second * tau, 1.0]))
    _, exact = ct.step_response(plant, t)
    np.testing.assert_allclose(out, 0.05 * exact, atol=0.05 * 0.01)  # a tick between the stages
    assert np.sum(0.05 - out) * dt / 0.05 == pytest.approx(tau, abs=1.5 * dt)  # late by tau in all


def test_the_rate_is_limited_and_the_stops_hold(servo):
    pipeline = servo(delay=0.0, tau=0.02, rate_limit=0.5, cyclic_max=0.1)
    out = respond(pipeline, [0.0] + [3.0] * 400, 0.002)
    assert np.diff(out).max() == pytest.approx(0.5 * 0.002)
    assert out[-1] == pytest.approx(0.1, abs=1e-6)
    assert respond(servo(), [-3.0] * 500, 0.002)[-1] == pytest.approx(-np.radians(8.0), abs=1e-6)
    assert respond(servo(), [1.5] * 500, 0.002, "throttle")[-1] == pytest.approx(1.0, abs=1e-6)
    assert respond(servo(), [-1.0] * 500, 0.002, "collective")[-1] == pytest.approx(-np.radians(3.0), abs=1e-6)


def test_servos_stand_at_the_first_command(servo):
    assert respond(servo(), [0.03, 0.03], 0.002) == pytest.approx([0.03, 0.03])
