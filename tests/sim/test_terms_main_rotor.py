import math

import numpy as np
import pytest
from scipy.optimize import brentq

from flightlog.constants import GRAVITY


def rotor(model, collective, *, climb=0.0, forward=0.0, height=100.0, speed=None, names=("main_rotor",)):
    """The signals of the rotor alone, at rest in a steady flow."""
    pipeline = model(*names)
    s = pipeline.signals()
    s["collective"], s["density"], s["height"], s["up"] = collective, 1.225, height, (0.0, 0.0, 1.0)
    s["velocity"] = (forward, 0.0, climb)
    if speed is not None:
        s["rotor_speed"] = speed
    pipeline.settle(s, 0.002, 1000, -1.0)
    return s


def area(raptor):
    return math.pi * float(raptor.geometry["rotor_radius"]) ** 2


def test_hover_trim_agrees_with_momentum_and_blade_element_theory(raptor, hover):
    _, at = hover(height=100.0)
    s, disc = at.signals, at.signals["density"] * area(raptor)
    thrust = float(s["thrust"])
    weight = float(s["mass"]) * GRAVITY
    assert weight < thrust < 1.04 * weight  # the fuselage hangs in the downwash: 2 % of the weight

    induced = math.sqrt(thrust / (2.0 * disc))
    assert s["inflow"] == pytest.approx(induced, rel=0.002)
    assert s["inflow"] == pytest.approx(math.sqrt(weight / (2.0 * disc)), rel=0.02)

    tip = raptor.geometry["nominal_speed"] * raptor.geometry["rotor_radius"]
    solidity, numbers = raptor.geometry["rotor_solidity"], raptor.parameters["main_rotor"]
    coefficient = thrust / (disc * tip**2)
    pitch = 6.0 * coefficient / (solidity * numbers["lift_slope"]) + 1.5 * math.sqrt(coefficient / 2.0)
    assert s["collective"] == pytest.approx(pitch, rel=0.002)

    power = s["rotor_torque"] * s["rotor_speed"]
    profile = disc * tip**3 * solidity * numbers["profile_drag"] / 8.0
    assert power - profile == pytest.approx(numbers["induced_factor"] * thrust * induced, rel=0.002)
    assert power == pytest.approx(440.0, rel=0.03)  # by hand for 5 kg


def test_thrust_balances_momentum_in_climb_and_forward_flight(raptor, model):
    for climb, forward in ((0.0, 0.0), (2.0, 0.0), (0.0, 4.0), (1.0, 12.0), (-0.7, 0.0), (-1.0, 6.0)):
        s = rotor(model, 0.08, climb=climb, forward=forward)
        flow = math.hypot(forward, climb + s["inflow"])
        assert s["thrust"] == pytest.approx(2.0 * 1.225 * area(raptor) * s["inflow"] * flow, rel=1e-6)


def test_inflow_in_hover_dies_away_with_pitt_and_peters_time_constant(raptor, model):
    pipeline = model("main_rotor")
    pipeline.set_parameter("main_rotor", "lift_slope", 1e-9)  # thrust does not answer: the air's own time constant
    index = pipeline.state_index("main_rotor.inflow")
    s = pipeline.signals()
    s["density"] = 1.225
    # without thrust dv/dt = -2 v |v|/(inflow_mass R): 1/v grows linearly
    pipeline.state[index] = start = 3.457
    for _ in range(5000):
        pipeline.run(s, 1e-5)
    mass = raptor.parameters["main_rotor"]["inflow_mass"] * float(raptor.geometry["rotor_radius"])
    assert pipeline.state[index] == pytest.approx(1.0 / (1.0 / start + 2.0 * 0.05 / mass), rel=1e-3)
    # about a thrust that balances 3.457 m/s the same equation gives 1/tau = 4 v/(inflow_mass R): 45 ms
    assert mass / (4.0 * start) == pytest.approx(0.045, abs=0.001)


def test_the_same_flow_at_any_tick(model):
    def respond(dt):
        pipeline = model("main_rotor")
        s = pipeline.signals()
        s["collective"], s["density"], s["up"] = 0.08, 1.225, (0.0, 0.0, 1.0)
        for _ in range(round(0.04 / dt)):
            pipeline.run(s, dt)
        return s["thrust"]

    assert respond(0.002) == pytest.approx(respond(1e-5), rel=0.02)
    assert respond(0.02) == pytest.approx(respond(1e-5), rel=0.15)


def test_descent_through_the_vortex_ring_stays_finite_and_near_measurements(raptor, model):
    # Leishman's fit to measured inflow in descent (Principles of Helicopter Aerodynamics, chapter 2)
    fit = np.polynomial.Polynomial([1.0, -1.125, -1.372, -1.718, -0.655])
    disc = 1.225 * area(raptor)
    hover_inflow = math.sqrt(49.0 / (2.0 * disc))
    for descent, allowed in ((0.3, 0.08), (0.5, 0.09), (1.0, 0.12)):
        climb = -descent * hover_inflow
        collective = brentq(lambda angle, climb=climb: rotor(model, angle, climb=climb)["thrust"] - 49.0, 0.0, 0.2)
        s = rotor(model, collective, climb=climb)
        assert s["inflow"] / hover_inflow == pytest.approx(fit(-descent), rel=allowed)
    for climb in np.linspace(-40.0, 0.0, 41):
        s = rotor(model, 0.05, climb=climb)
        assert np.isfinite([s["thrust"], s["inflow"], s["rotor_torque"]]).all()


def test_a_rotor_at_rest_does_nothing(model):
    s = rotor(model, 0.1, forward=8.0, climb=-1.0, speed=0.0)
    assert s["thrust"] == 0.0
    assert s["rotor_torque"] == 0.0


def test_a_windmilling_rotor_takes_no_more_than_the_air_gives(model):
    driven = 0
    for climb in np.linspace(-15.0, -1.0, 15):
        for collective in (-0.02, 0.0, 0.03, 0.06):
            s = rotor(model, collective, climb=climb)
            driven += s["rotor_torque"] < 0.0
            assert -s["rotor_torque"] * s["rotor_speed"] <= max(-s["thrust"] * climb, 0.0)
    assert driven > 5  # there is autorotation


def test_thrust_scale_scales_blade_lift(raptor, model):
    pipeline = model("main_rotor")
    pipeline.set_parameter("main_rotor", "thrust_scale", 0.9)
    pipeline.set_parameter("main_rotor", "inflow_mass", 5.0)
    s = pipeline.signals()
    s["collective"], s["density"], s["up"] = 0.08, 1.225, (0.0, 0.0, 1.0)
    pipeline.run(s, 1e-9)
    reduced = float(s["thrust"])
    pipeline.set_parameter("main_rotor", "thrust_scale", 1.0)
    pipeline.state[:] = 0.0
    pipeline.run(s, 1e-9)
    assert reduced == pytest.approx(0.9 * s["thrust"], rel=1e-6)


@pytest.mark.parametrize("over_radius", [0.5, 0.62, 1.0, 1.5, 2.0])
def test_ground_effect_at_constant_rotor_power_is_cheeseman_and_bennetts(raptor, model, over_radius):
    names = ("ground_effect", "main_rotor")
    radius, hub = float(raptor.geometry["rotor_radius"]), float(raptor.geometry["hub"][2])
    collective = 0.075
    # 1e6 m: out of ground effect; torque at one rotor speed stands for power
    free = rotor(model, collective, height=1e6, names=names)
    height = over_radius * radius - hub

    def excess(angle):
        return rotor(model, angle, height=height, names=names)["rotor_torque"] - free["rotor_torque"]

    near = rotor(model, brentq(excess, 0.03, 0.12, xtol=1e-10), height=height, names=names)
    assert near["thrust"] / free["thrust"] == pytest.approx(1.0 / (1.0 - (1.0 / (4.0 * over_radius)) ** 2), rel=1e-3)


def test_ground_effect_fades_with_airspeed_and_height(raptor, model):
    radius, hub = float(raptor.geometry["rotor_radius"]), float(raptor.geometry["hub"][2])
    names = ("ground_effect", "main_rotor")
    for forward in (0.0, 2.0, 5.0, 15.0):
        s = rotor(model, 0.08, forward=forward, height=radius - hub, names=names)
        induced = s["inflow"] / s["ground"]
        k = (1.0 / 4.0) ** 2 / (1.0 + (forward / induced) ** 2)
        assert s["ground"] == pytest.approx((1.0 - k) ** 1.5, rel=1e-6)
    lowest = rotor(model, 0.08, height=0.5 * radius - hub, names=names)["ground"]
    assert rotor(model, 0.08, height=0.0, names=names)["ground"] == lowest  # held where the formula ends


def test_ground_effect_knows_where_the_hub_is_when_the_body_leans(raptor, model):
    pipeline = model("ground_effect")
    s = pipeline.signals()
    s["height"], s["up"], s["inflow"] = 0.6, (0.0, math.sin(0.6), math.cos(0.6)), 3.0
    pipeline.run(s, 0.002)
    hub = 0.6 + raptor.geometry["hub"][2] * math.cos(0.6)
    k = (raptor.geometry["rotor_radius"] / (4.0 * hub)) ** 2
    assert s["ground"] == pytest.approx((1.0 - k) ** 1.5, rel=1e-9)
