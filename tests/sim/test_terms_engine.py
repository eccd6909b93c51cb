import numpy as np
import pytest


def shaft(model, *names):
    pipeline = model(*names)
    s = pipeline.signals()
    s["density"], s["up"], s["height"] = 1.225, (0.0, 0.0, 1.0), 100.0
    return pipeline, s


def test_the_shaft_obeys_its_torques(raptor, model):
    pipeline, s = shaft(model, "engine")
    numbers = raptor.parameters["engine"]
    pipeline.state[:] = (150.0, 0.25)
    s["throttle"], s["rotor_torque"], s["tail_torque"] = 0.25, 2.0, 0.2
    pipeline.run(s, 0.002)
    torque = 0.25 * numbers["power_max"] / 150.0
    assert s["engine_torque"] == pytest.approx(torque)
    assert s["rotor_speed"] == 150.0
    assert s["rotor_acceleration"] == pytest.approx((torque - 2.2) / numbers["inertia"])
    assert pipeline.state[0] == pytest.approx(150.0 + 0.002 * s["rotor_acceleration"])
    # a clockwise rotor pushes the nose left; the tail drive's share is reacted elsewhere
    assert s["moment"] == pytest.approx((0.0, 0.0, torque - 0.2))


def test_power_answers_the_throttle_with_its_lag_and_torque_is_limited(raptor, model):
    numbers = raptor.parameters["engine"]
    pipeline, s = shaft(model, "engine")
    index = pipeline.state_index("engine.speed")
    s["throttle"] = 1.0
    for k in range(1, 101):
        pipeline.state[index] = 150.0
        pipeline.run(s, 0.002)
        power = numbers["power_max"] * (1.0 - np.exp(-k * 0.002 / numbers["tau"]))
        assert s["engine_torque"] * 150.0 == pytest.approx(power, rel=1e-9)
    for _ in range(1000):
        pipeline.state[index] = 1.0
        pipeline.run(s, 0.002)
    assert s["engine_torque"] == pytest.approx(numbers["torque_max"], rel=1e-6)


def test_without_throttle_the_rotor_runs_down_and_its_energy_goes_into_the_air(raptor, model):
    pipeline, s = shaft(model, "engine", "main_rotor", "tail_rotor")
    inertia = raptor.parameters["engine"]["inertia"]
    index = pipeline.state_index("engine.speed")
    pipeline.state[index] = first = 157.0
    s["collective"] = 0.03
    spent, speeds = 0.0, []
    for _ in range(10000):
        drag = s["rotor_torque"] + s["tail_torque"]
        pipeline.run(s, 0.002)
        spent += drag * s["rotor_speed"] * 0.002
        speeds.append(float(s["rotor_speed"]))
    assert np.all(np.diff(speeds[1:]) < 0.0)
    assert 0.0 <= speeds[-1] < 0.2 * first
    assert 0.5 * inertia * (first**2 - pipeline.state[index] ** 2) == pytest.approx(spent, rel=0.01)
    assert s["engine_torque"] == 0.0


def test_the_clutch_drives_one_way(model):
    pipeline, s = shaft(model, "engine", "main_rotor")
    pipeline.state[pipeline.state_index("engine.speed")] = 120.0
    s["velocity"] = (0.0, 0.0, -8.0)  # autorotation: the air drives the rotor
    for _ in range(1000):
        pipeline.run(s, 0.002)
    assert s["engine_torque"] == 0.0
    assert s["rotor_speed"] > 125.0


def test_fuel_burns_while_the_throttle_is_open_and_an_empty_tank_stops_the_engine(raptor, model):
    pipeline = model("fuel")
    numbers = raptor.parameters["fuel"]
    s = pipeline.signals()
    s["throttle"] = 0.2
    for _ in range(1000):
        pipeline.run(s, 0.1)
    assert s["mass"] == pytest.approx(5.0 - 100.0 * numbers["rate"])
    s["throttle"] = 0.0
    pipeline.run(s, 0.1)
    assert s["mass"] == pytest.approx(5.0 - 100.0 * numbers["rate"])
    for _ in range(10000):
        s["throttle"] = 0.2
        pipeline.run(s, 0.1)
    assert s["mass"] == pytest.approx(5.0 - numbers["capacity"])
    assert s["throttle"] == 0.0
