import math
import re
import runpy
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest

from controllers.gains import Gains
from controllers.margins import (
    OUTPUTS,
    REQUIRED_GAIN_DB,
    REQUIRED_PHASE_DEG,
    frequencies,
    loop_margins,
    margins,
    pilot_response,
    plant_response,
)
from controllers.pilot import Pilot
from controllers.plant import SAMPLE_TIME, LinearPlant
from controllers.sequence import Hover
from flightlog.signals import StateEstimate

ROOT = Path(__file__).parents[2]


def test_every_loop_has_the_margins_that_are_promised(gains: Gains, plant: LinearPlant) -> None:
    found, together = margins(gains, plant)
    assert [m.actuator for m in found] == list(plant.input_names)
    for m in found:
        assert m.gain_up_db >= REQUIRED_GAIN_DB, m
        assert m.gain_down_db >= REQUIRED_GAIN_DB, m
        assert m.phase_deg >= REQUIRED_PHASE_DEG, m
        assert m.delay > 0.05, m
        assert m.disk > 0.6, m
    assert 0.5 < together <= min(m.disk for m in found) + 1e-9


@pytest.mark.parametrize("fault", ["slower servos", "three times the velocity gain"])
def test_a_bad_loop_is_seen(gains: Gains, plant: LinearPlant, fault: str) -> None:
    if fault == "slower servos":
        plant = replace(plant, delay=plant.delay + 0.1)
    else:
        velocity = replace(gains.velocity, proportional=3.0 * gains.velocity.proportional)
        gains = replace(gains, velocity=velocity)
    found, _ = margins(gains, plant)
    assert min(m.phase_deg for m in found) < 35.0


def test_the_margins_of_a_textbook_loop_come_out() -> None:
    """1/(s (s + 1)^2): gain margin 2 at 1 rad/s, phase margin 21.39 deg at 0.6823 rad/s."""
    omega = frequencies()
    s = 1j * omega
    found = loop_margins("loop", omega, 1.0 / (s * (s + 1.0) ** 2))
    assert found.gain_up_db == pytest.approx(20.0 * math.log10(2.0), abs=1e-3)
    assert found.phase_deg == pytest.approx(21.386, abs=1e-2)
    assert found.crossover == pytest.approx(0.6823, abs=1e-4)
    assert found.delay == pytest.approx(math.radians(21.386) / 0.6823, rel=1e-3)
    expected = control.disk_margins(control.tf([1], [1, 2, 1, 0]), omega, skew=0.0)[0]
    assert found.disk == pytest.approx(expected, rel=1e-3)


def estimate(t: float, gains: Gains, **off: float) -> StateEstimate:
    """The trimmed hover at (0, 0, 10), heading north, with this much off."""
    at = {name: off.get(name, 0.0) for name in OUTPUTS}
    return StateEstimate(
        t=t,
        position=np.array([at["right"], at["forward"], 10.0 + at["height"]]),
        velocity=np.array([at["v_right"], at["v_forward"], at["climb"]]),
        acceleration=np.zeros(3),
        quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
        roll=gains.velocity.trim_roll + at["roll"],
        pitch=gains.velocity.trim_pitch + at["pitch"],
        heading=at["heading"] % (2.0 * math.pi),
        rates=np.array([at["wx"], at["wy"], at["wz"]]),
        rotor_speed=gains.governor.rotor_speed + at["rotor_speed"],
        std_position=np.full(3, 0.03),
        std_velocity=np.full(3, 0.03),
        std_attitude=np.full(3, 0.005),
        pad_age=0.0,
        height_age=0.0,
    )


@pytest.mark.parametrize("periods", [300, 2500])
@pytest.mark.parametrize("output", OUTPUTS)
def test_the_formulas_are_what_the_pilot_does(gains: Gains, output: str, periods: int) -> None:
    """A sine on one of its inputs comes out of the pilot in flight as the frequency response says."""
    omega = 2.0 * math.pi / (periods * SAMPLE_TIME)
    expected = pilot_response(gains, np.array([omega]))[0, :, OUTPUTS.index(output)]
    pilot = Pilot(gains, Hover(), heading=0.0)
    size = 1e-4
    pilot.update(estimate(0.0, gains))
    answer = []
    # lags die away in the first second, and with whole periods the integrals' constants drop out of the correlation
    settling = periods * math.ceil(1.0 / (periods * SAMPLE_TIME))
    for k in range(settling + periods):
        value = size * math.sin(omega * k * SAMPLE_TIME)
        sent = pilot.update(estimate(k * SAMPLE_TIME, gains, **{output: value}))
        answer.append(np.subtract(sent, gains.trim))
    turning = np.exp(-1j * omega * SAMPLE_TIME * np.arange(settling, settling + periods))
    found = 2j / periods / size * (turning @ np.array(answer[settling:]))
    largest = np.abs(expected).max()
    assert found == pytest.approx(expected, rel=0.02, abs=0.01 * largest)


def test_the_plants_response_has_the_signs_of_the_conventions(plant: LinearPlant) -> None:
    """collective > 0 climbs, tail > 0 turns the nose right (wz < 0): both integrate once the lags are taken out."""
    response = plant_response(plant, np.array([30.0]))[0]
    at = {name: i for i, name in enumerate(OUTPUTS)}
    inputs = {name: i for i, name in enumerate(plant.input_names)}
    late = np.exp(1j * 30.0 * (float(plant.delay[0]) + 0.008)) * (1.0 + 30.0j * 0.026)
    climb = response[at["climb"], inputs["collective"]] * late * 1j
    turn = response[at["wz"], inputs["tail"]] * late * 1j
    assert climb.real > 0.0
    assert turn.real < 0.0


def test_docs_controllers_is_up_to_date() -> None:
    written = (ROOT / "docs" / "controllers.md").read_text()
    made = runpy.run_path(str(ROOT / "benchmarks" / "margins.py"))["document"]()
    number = r"[-+]?\d+(?:\.\d+)?"
    assert re.sub(number, "#", made) == re.sub(number, "#", written)
    numbers = [np.array(re.findall(number, text), dtype=float) for text in (made, written)]
    assert numbers[0] == pytest.approx(numbers[1], rel=0.02, abs=0.011)
