import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp


def plane(model, direction=-1.0, **signals):
    pipeline = model("flapping", direction=direction)
    s = pipeline.signals()
    for name, value in signals.items():
        s[name] = value
    return pipeline, s


@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_the_tip_path_plane_follows_its_differential_equation(raptor, model, direction):
    numbers = raptor.parameters["flapping"]
    speed = 0.9 * raptor.geometry["nominal_speed"]
    rates, collective, inflow, velocity = (0.4, -0.3, 0.8), 0.08, 3.0, (6.0, -2.0, 0.5)
    pipeline, s = plane(
        model, direction, lateral=0.02, longitudinal=-0.03, rates=rates, velocity=velocity, collective=collective,
        inflow=inflow, rotor_speed=speed,
    )  # fmt: skip
    hub, tip = raptor.geometry["hub"], speed * float(raptor.geometry["rotor_radius"])
    at_hub = np.array(velocity) + np.cross(rates, hub)
    lean = 2.0 * numbers["speed_derivative"] * (4.0 / 3.0 * collective - inflow / tip) / tip
    tau, cross = numbers["tau"] / 0.9, direction * numbers["coupling"]

    def slope(_, flap):
        back, right = flap
        return (
            rates[1] + (-0.81 * numbers["longitudinal_gain"] * -0.03 + lean * at_hub[0] - back + cross * right) / tau,
            -rates[0] + (0.81 * numbers["lateral_gain"] * 0.02 + lean * at_hub[1] - right - cross * back) / tau,
        )

    exact = solve_ivp(slope, (0.0, 0.2), (0.0, 0.0), rtol=1e-10, atol=1e-12).y[:, -1]
    for _ in range(100):
        pipeline.run(s, 0.002)
    np.testing.assert_allclose([s["flap_back"], s["flap_right"]], exact, rtol=1e-8)


def settled(model, direction=-1.0, **signals):
    pipeline, s = plane(model, direction, **signals)
    pipeline.settle(s, 0.002, 2000, -1.0)
    return float(s["flap_back"]), float(s["flap_right"])


def test_cyclic_leans_the_plane_where_it_points(model):
    back, right = settled(model, longitudinal=0.02)
    assert back == pytest.approx(-0.02 * 4.2, rel=0.02)
    assert abs(right) < 0.1 * abs(back)
    back, right = settled(model, lateral=0.02)
    assert right == pytest.approx(0.02 * 4.2, rel=0.02)


def test_a_stiff_hub_couples_the_axes_as_the_rotor_turns(model):
    # Padfield's counter-clockwise rotor leans right under a command forward; a clockwise one leans left
    assert settled(model, +1.0, longitudinal=0.02)[1] > 0.0
    assert settled(model, -1.0, longitudinal=0.02)[1] < 0.0


def test_the_plane_lags_behind_a_turning_body_and_damps_it(raptor, model):
    tau = raptor.parameters["flapping"]["tau"]
    assert settled(model, rates=(0.5, 0.0, 0.0))[1] == pytest.approx(-0.5 * tau, rel=0.01)  # rolls right: leans left
    assert settled(model, rates=(0.0, 0.5, 0.0))[0] == pytest.approx(0.5 * tau, rel=0.01)  # nose down: leans back
    pipeline, s = plane(model, rates=(0.0, 0.5, 0.0))
    pipeline.run(s, 1e-5)
    assert s["flap_back"] == pytest.approx(0.5e-5, rel=1e-3)  # at first it stays where it is in space


def test_the_plane_leans_away_from_where_it_flies(model):
    assert settled(model, velocity=(8.0, 0.0, 0.0), collective=0.08)[0] > 0.0
    assert settled(model, velocity=(0.0, 8.0, 0.0), collective=0.08)[1] > 0.0


def test_cyclic_loses_with_the_square_of_rotor_speed_and_stops_hold(raptor, model):
    full = settled(model, lateral=0.01)[1]
    assert settled(model, lateral=0.01, rotor_speed=0.5 * raptor.geometry["nominal_speed"])[1] == pytest.approx(
        full / 4
    )
    back, right = settled(model, lateral=0.14, longitudinal=0.14)
    assert math.hypot(back, right) == pytest.approx(raptor.parameters["flapping"]["flap_max"])


def test_the_hub_gives_thrust_along_the_plane_and_stiffness_plus_height_as_moment(raptor, model):
    pipeline = model("hub")
    s = pipeline.signals()
    s["thrust"], s["flap_back"], s["flap_right"] = 50.0, 0.02, 0.03
    pipeline.run(s, 0.002)
    assert np.linalg.norm(s["force"]) == pytest.approx(50.0)
    assert s["force"][0] == pytest.approx(-50.0 * math.sin(0.02))
    assert s["force"][1] == pytest.approx(-50.0 * math.sin(0.03))
    per_angle = raptor.parameters["hub"]["stiffness"] + 50.0 * raptor.geometry["hub"][2]
    assert s["moment"] == pytest.approx((per_angle * 0.03, -per_angle * 0.02, 0.0), rel=1e-3)
