"""Tail rotor, fuselage and fins; and the energy of the whole."""

import math

import numpy as np
import pytest

from flightlog.constants import GRAVITY


def instant(pipeline, **signals):
    s = pipeline.signals()
    s["density"], s["up"] = 1.225, (0.0, 0.0, 1.0)
    for name, value in signals.items():
        s[name] = value
    pipeline.run(s, 0.002)
    return s


@pytest.mark.parametrize("axial", [0.0, 2.0, -1.0])
@pytest.mark.parametrize("tail", [-0.4, 0.0, 0.1])
def test_the_tail_rotors_blades_and_its_air_agree(raptor, model, tail, axial):
    numbers = raptor.parameters["tail_rotor"]
    s = instant(model("tail_rotor"), tail=tail, velocity=(0.0, axial, 0.0))
    tip = numbers["gear"] * s["rotor_speed"] * numbers["radius"]
    disc = 1.225 * math.pi * numbers["radius"] ** 2
    thrust = float(s["tail_thrust"])
    climb = axial / tip
    half = 0.5 * numbers["solidity"] * numbers["lift_slope"]
    inflow = 2.0 * ((tail + numbers["trim"]) / 3.0 - thrust / (disc * tip**2 * half)) - climb  # blade element
    # momentum, with the flow through the disc against the thrust's own direction
    assert thrust == pytest.approx(2.0 * disc * tip**2 * inflow * abs(climb + inflow), rel=1e-9)
    power = thrust * (axial + inflow * tip) + disc * tip**3 * numbers["solidity"] * numbers["profile_drag"] / 8.0
    assert s["tail_torque"] * s["rotor_speed"] == pytest.approx(power, rel=1e-9)


def test_the_tail_rotor_pushes_at_its_hub_and_damps_yaw(raptor, model):
    pipeline, hub = model("tail_rotor"), raptor.geometry["tail_hub"]
    s = instant(pipeline)
    np.testing.assert_allclose(s["force"], (0.0, s["tail_thrust"], 0.0))
    np.testing.assert_allclose(s["moment"], np.cross(hub, s["force"]), atol=1e-12)
    assert s["tail_thrust"] > 0.0
    still = s["moment"][2]
    assert (
        instant(pipeline, rates=(0.0, 0.0, 1.0))["moment"][2]
        < still
        < instant(pipeline, rates=(0, 0, -1.0))["moment"][2]
    )


def test_tail_thrust_has_no_jumps(model):
    pipeline = model("tail_rotor")
    for axial in (-20.0, -10.0, -6.0, 0.0, 6.0, 20.0):
        thrust = [
            instant(pipeline, tail=tail, velocity=(0.0, axial, 0.0))["tail_thrust"] for tail in np.linspace(-1, 1, 801)
        ]
        assert np.all(np.diff(thrust) > -1e-12)
        assert np.max(np.diff(thrust)) < 0.5


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_drag_of_a_flat_plate_on_each_axis(raptor, model, axis):
    area = list(raptor.parameters["fuselage"].values())[axis]
    for speed in (-7.0, 7.0):
        velocity = np.zeros(3)
        velocity[axis] = speed
        force = instant(model("fuselage"), velocity=velocity)["force"]
        assert force[axis] == pytest.approx(-0.5 * 1.225 * area * abs(speed) * speed)
        assert np.count_nonzero(force) == 1


def test_downwash_hangs_on_the_fuselage(raptor, model):
    force = instant(model("fuselage"), inflow=3.5)["force"]
    assert force[2] == pytest.approx(-0.5 * 1.225 * raptor.parameters["fuselage"]["plan_area"] * 3.5**2)


def test_the_air_takes_energy_from_a_moving_airframe(model):
    random = np.random.default_rng(1)
    pipeline = model("fuselage", "fins")
    for _ in range(200):
        velocity, rates = random.normal(0.0, 6.0, 3), random.normal(0.0, 2.0, 3)
        s = instant(pipeline, velocity=velocity, rates=rates)
        assert s["force"] @ velocity + s["moment"] @ rates < 0.0


def test_fins_turn_the_nose_into_the_flow_and_damp(raptor, model):
    pipeline, hub = model("fins"), raptor.geometry["tail_hub"]
    s = instant(pipeline, velocity=(10.0, 1.0, 0.0))  # air from ahead and from the left
    area, slope = raptor.parameters["fins"]["vertical_area"], raptor.parameters["fins"]["vertical_slope"]
    assert s["force"][1] == pytest.approx(-0.5 * 1.225 * area * (slope * 10.0 + 1.0) * 1.0)
    np.testing.assert_allclose(s["moment"], np.cross(hub, (0.0, s["force"][1], 0.0)), atol=1e-12)
    assert s["moment"][2] > 0.0  # nose left
    assert instant(pipeline, velocity=(10.0, 0.0, 1.0))["moment"][1] < 0.0  # climbs: air from above lifts the nose
    assert instant(pipeline, rates=(0.0, 1.0, 0.0), velocity=(10.0, 0.0, 0.0))["moment"][1] < 0.0
    assert instant(pipeline, rates=(0.0, 0.0, 1.0), velocity=(10.0, 0.0, 0.0))["moment"][2] < 0.0


def test_with_the_engine_off_a_flight_only_loses_energy(raptor, hover, body):
    pipeline, at = hover()
    inertia = raptor.parameters["engine"]["inertia"]
    pipeline.set_parameter("fuel", "rate", 0.0)
    machine = body(pipeline, at)
    for _ in range(200):  # until engine and servos have come to rest
        machine.step(at.controls._replace(throttle=0.0, collective=0.03))

    def energy():
        turning = 0.5 * inertia * machine.s["rotor_speed"] ** 2 + 0.5 * raptor.inertia @ machine.rates**2
        return turning + 0.5 * 5.0 * machine.velocity @ machine.velocity + 5.0 * GRAVITY * machine.position[2]

    energies = []
    for _ in range(500):
        machine.step(at.controls._replace(throttle=0.0, collective=0.03))
        energies.append(energy())
    lost = -np.diff(energies)
    print(f"energy {energies[0]:.0f} J to {energies[-1]:.0f} J, least loss in a tick {lost.min():.4f} J")
    assert lost.min() > 0.0


def test_a_pirouette_turns_on_the_spot(hover, body):
    pipeline, at = hover()
    pipeline.set_parameter("fuel", "rate", 0.0)
    machine = body(pipeline, at)
    for _ in range(150):
        machine.step(at.controls._replace(tail=at.controls.tail + 0.01))
    assert machine.rates[2] < -0.1
    assert np.abs(machine.rates[:2]).max() < 0.1 * abs(machine.rates[2])
    assert np.linalg.norm(machine.velocity) < 0.05
