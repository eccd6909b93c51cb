import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flightlog.rotations import angles, matrix, quaternion
from sim.linearisation import BODY, LAGS, linearise, trim


def test_the_residual_of_a_trim_is_nothing(raptor, model):
    pipeline = model()
    for velocity in ((0.0, 0.0, 0.0), (3.0, 4.0, 0.0), (0.0, -6.0, 0.5), (0.0, 12.0, -0.5)):
        at = trim(pipeline, raptor.inertia, velocity=velocity, wind=(1.0, 1.0, 0.0), heading=0.7)
        s = at.signals
        np.testing.assert_allclose(s["force"], s["mass"] * 9.80665 * s["up"], atol=1e-6)
        np.testing.assert_allclose(s["moment"], 0.0, atol=1e-6)
        assert abs(s["rotor_acceleration"]) < 1e-6
        r = matrix(quaternion(at.roll, at.pitch, at.heading))
        np.testing.assert_allclose(r @ s["velocity"], np.array(velocity) - (1.0, 1.0, 0.0), atol=1e-12)


def test_the_pipeline_is_left_as_it_was(hover):
    pipeline, at = hover()
    pipeline.state[:] *= 1.001
    state, numbers = pipeline.state.copy(), pipeline.parameters.copy()
    trim(pipeline, at.inertia)
    linearise(pipeline, at)
    np.testing.assert_array_equal(pipeline.state, state)
    np.testing.assert_array_equal(pipeline.parameters, numbers)


def test_hover_in_wind_is_flight_against_it(hover):
    _, in_wind = hover(wind=(0.0, -5.0, 0.0))
    _, flying = hover(velocity=(0.0, 5.0, 0.0))
    assert in_wind.controls == pytest.approx(flying.controls, abs=1e-9)
    assert in_wind.pitch < math.radians(-1.0)  # leans into the wind that comes from ahead
    _, turned = hover(wind=(5.0, 0.0, 0.0), heading=1.5 * math.pi)
    assert turned.controls == pytest.approx(in_wind.controls, abs=1e-9)


def test_a_flight_that_the_controls_cannot_hold_is_refused(hover):
    with pytest.raises(ValueError, match="no trim"):
        hover(velocity=(0.0, 60.0, 0.0))


def test_a_model_without_an_engine_trims_at_its_nominal_speed(model, hover):
    _, at = hover(model(without=["engine", "fuel", "servo"]))
    assert at.signals["rotor_speed"] == pytest.approx(50.0 * math.pi)


def test_names_and_delays_are_told(hover):
    pipeline, at = hover()
    plant = linearise(pipeline, at)
    assert plant.state_names == (*BODY, *LAGS)
    assert plant.A.shape == (19, 19)
    assert plant.B.shape == (19, 5)
    assert plant.input_names == ("collective", "lateral", "longitudinal", "tail", "throttle")
    np.testing.assert_allclose(plant.delay, 0.02)
    assert plant.indices("wx", "flapping.back") == [3, 12]


def test_the_linear_plant_has_the_derivatives_of_the_equations(raptor, hover):
    pipeline, at = hover()
    plant = linearise(pipeline, at)
    s, numbers, geometry = at.signals, raptor.parameters, raptor.geometry

    def entry(row, column):
        return plant.A[plant.state_names.index(row), plant.state_names.index(column)]

    disc = math.pi * geometry["rotor_radius"] ** 2 * s["density"]
    tip = s["rotor_speed"] * geometry["rotor_radius"]
    lift = 0.5 * disc * geometry["rotor_solidity"] * numbers["main_rotor"]["lift_slope"]
    mass_air = numbers["main_rotor"]["inflow_mass"] * disc * geometry["rotor_radius"]
    assert entry("vz", "servo.collective") == pytest.approx(lift * tip**2 / 3.0 / 5.0, rel=1e-3)
    assert entry("main_rotor.inflow", "servo.collective") == pytest.approx(lift * tip**2 / 3.0 / mass_air, rel=1e-3)
    moment = numbers["hub"]["stiffness"] + s["thrust"] * geometry["hub"][2]
    assert entry("wx", "flapping.right") == pytest.approx(moment / raptor.inertia[0], rel=2e-3)
    assert entry("wy", "flapping.back") == pytest.approx(-moment / raptor.inertia[1], rel=2e-3)
    assert entry("vx", "pitch") == pytest.approx(-9.80665, rel=1e-5)
    assert entry("vy", "roll") == pytest.approx(-9.80665 * math.cos(at.roll), rel=1e-5)
    assert entry("flapping.back", "wy") == pytest.approx(1.0, rel=1e-3)
    assert entry("engine.throttle", "servo.throttle") == pytest.approx(1.0 / numbers["engine"]["tau"], rel=1e-4)
    for name, tau in (("lateral", "tau"), ("throttle", "throttle_tau")):
        row, column = plant.state_names.index(f"servo.{name}"), plant.input_names.index(name)
        assert plant.B[row, column] == pytest.approx(1.0 / numbers["servo"][tau], rel=1e-4)


def test_vertical_damping_of_the_quasi_steady_rotor_is_padfields(raptor, model, hover):
    """Padfield 1996, chapter 4: Z_w = -2 a sigma rho Omega R pi R^2 lambda/((16 lambda + a sigma) m)."""
    pipeline, at = hover(model(without=["fuselage", "fins"]), height=100.0)
    plant = linearise(pipeline, at)
    s, geometry = at.signals, raptor.geometry
    tip = s["rotor_speed"] * geometry["rotor_radius"]
    lift = geometry["rotor_solidity"] * raptor.parameters["main_rotor"]["lift_slope"]
    inflow = s["inflow"] / tip
    padfield = 2.0 * lift * s["density"] * tip * math.pi * geometry["rotor_radius"] ** 2 * inflow
    padfield /= (16.0 * inflow + lift) * 5.0
    (ww, wi), (iw, ii) = plant.A[np.ix_(*[plant.indices("vz", "main_rotor.inflow")] * 2)]
    assert ww - wi * iw / ii == pytest.approx(-padfield, rel=0.005)
    assert padfield == pytest.approx(1.06, abs=0.02)


# states measured by the same yardstick
GROUPS = (
    slice(0, 3),
    slice(3, 6),
    slice(6, 9),
    slice(9, 10),
    slice(10, 11),
    slice(11, 12),
    slice(12, 14),
    slice(14, 19),
)


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (5.0, 3.0, 0.0)])
@pytest.mark.parametrize("control", ["collective", "lateral", "longitudinal", "tail", "throttle"])
def test_the_linear_plant_foretells_the_model(hover, body, control, velocity):
    pipeline, at = hover(velocity=velocity, heading=1.0)  # far from where the heading wraps
    plant = linearise(pipeline, at)
    pipeline.set_parameter("fuel", "rate", 0.0)
    size, until = 1e-3, 0.5

    def fly(change):
        controls = at.controls._replace(**{control: getattr(at.controls, control) + change})
        machine = body(pipeline, at, dt=0.0005)
        for _ in range(round(until / machine.dt)):
            machine.step(controls)
        r = matrix(machine.q)
        lags = [pipeline.state[pipeline.state_index(name)] for name in LAGS]
        return np.array([*angles(machine.q), *machine.rates, *(r.T @ machine.velocity), *lags])

    nonlinear = 0.5 * (fly(size) - fly(-size))
    column = plant.input_names.index(control)
    linear = solve_ivp(
        lambda t, x: plant.A @ x + plant.B[:, column] * size, (0.0, until - plant.delay[column]), np.zeros(19),
        rtol=1e-9, atol=1e-12,
    ).y[:, -1]  # fmt: skip
    for group in GROUPS:
        assert np.abs(nonlinear - linear)[group].max() <= 0.02 * np.abs(linear[group]).max() + 5e-6
