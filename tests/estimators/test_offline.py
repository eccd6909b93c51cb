"""A navigator over a log: what stands in for what a log lacks."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimators import navigators
from estimators.kinematic import Angles, KinematicNavigator
from estimators.log_equipment import fit, white
from estimators.log_samples import arrivals
from estimators.offline import run
from estimators.screens import BaroScreen, SonarScreen
from flightlog.signals import BaroSample, GpsSample, ImuSample, SonarSample
from flightlog.tables import table
from sim import vehicle as vehicles
from sim.world import MAGNETIC_FIELD


@pytest.fixture(scope="module")
def nominal():
    raptor = vehicles.load("raptor90")
    return raptor.equipment(None, raptor.site(101_325.0, 288.15, MAGNETIC_FIELD))


def imu(t, rng, noise=0.05):
    rows = rng.normal(0.0, noise, (len(t), 6)) + [0.0, 0.0, 9.80665, 0.0, 0.0, 0.0]
    return table("measured", "imu", np.column_stack([t, rows]).tolist())


def gps(t, u=0.0, hdop=1.0):
    rows = [(s, math.nan, 0.0, 0.0, u, 0.0, 0.0, 0.0, 9, hdop, True) for s in t]
    return table("measured", "gps", rows)


def baro(t, altitude):
    return table("measured", "baro", [(s, 1e5, 288.0, a) for s, a in zip(t, altitude, strict=True)])


# --- noise levels -----------------------------------------------------------------------------------------------------


@given(st.floats(0.01, 5.0), st.integers(0, 1000))
def test_white_noise_is_found_under_motion_and_outliers(deviation, seed):
    rng = np.random.default_rng(seed)
    t = np.arange(4000) / 10.0
    values = 20.0 * np.sin(0.1 * t) + rng.normal(0.0, deviation, len(t))
    values[rng.integers(0, len(t), 80)] += 100.0
    assert white(values) == pytest.approx(deviation, rel=0.25)


def test_a_log_s_sensors_are_as_noisy_as_it_shows(nominal):
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 300.0, 0.1)
    climbs = 10.0 * np.sin(0.05 * t)
    drift = np.cumsum(rng.normal(0.0, 0.12, len(t)))
    tables = {"baro": baro(t, climbs + drift + rng.normal(0.0, 0.5, len(t))), "gps": gps(t[::2], hdop=1.8)}
    rows = [(s, math.nan, 0.0, 0.0, u, 0.0, 0.0, 0.0, 9, 1.8, True) for s, u in zip(t[::2], climbs[::2], strict=True)]
    tables["gps"] = table("measured", "gps", rows)
    found = fit(tables, nominal).sensors
    assert set(found) == {"baro", "gps"}
    assert found["baro"].rate == pytest.approx(10.0) and found["gps"].rate == pytest.approx(5.0)
    assert found["baro"]["noise"] == pytest.approx(0.5, rel=0.2)
    assert found["baro"]["drift_std"] > 1.0 and found["gps"]["wander_std_up"] > 1.0
    assert found["gps"]["hdop"] == pytest.approx(1.8)


def test_the_field_s_dip_is_taken_from_the_force_however_the_vehicle_leans(nominal):
    from flightlog.rotations import from_angles

    rng = np.random.default_rng(4)
    turn = from_angles(0.2, -0.1, 2.0)
    field = np.array([3.0, 20.0, -44.0])
    t = np.arange(0.0, 3.0, 0.02)
    force, seen = turn.inv().apply([0.0, 0.0, 9.8]), turn.inv().apply(field)
    tables = {
        "imu": table("measured", "imu", [(s, *(force + rng.normal(0, 0.05, 3)), 0.0, 0.0, 0.0) for s in t]),
        "mag": table("measured", "mag", [(s, *seen) for s in t]),
    }
    found = fit(tables, nominal, declination=math.atan2(3.0, 20.0)).magnetic_field
    np.testing.assert_allclose(found, field, atol=0.2)


def test_many_echoes_at_the_largest_range_are_none(nominal):
    ranges = np.concatenate([np.linspace(0.3, 6.3, 100), np.full(40, 6.4)])
    echoes = table("measured", "sonar", [(0.1 * k, r, True) for k, r in enumerate(ranges)])
    equipment = fit({"sonar": echoes}, nominal)
    heard = [sample.valid for _, sample in arrivals({"sonar": echoes}, equipment)]
    assert heard[100:] == [False] * 40 and sum(heard[:100]) > 97
    few = table("measured", "sonar", [(0.1 * k, r, True) for k, r in enumerate(ranges[:100])])
    assert all(sample.valid for _, sample in arrivals({"sonar": few}, fit({"sonar": few}, nominal)))


# --- screens ----------------------------------------------------------------------------------------------------------


@given(st.integers(0, 10_000))
def test_a_barometer_without_jumps_passes_whole(seed):
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 20.0, 0.1)
    altitude = 5.0 * np.sin(0.5 * t) + rng.normal(0.0, 0.2, len(t))
    screen = BaroScreen(0.2)
    passed = [s for t_, a in zip(t, altitude, strict=True) for s in screen.pass_on(BaroSample(t_, 1e5, 288.0, a))]
    assert screen.rejected == 0
    assert [s.altitude for s in passed] == altitude[: len(passed)].tolist()
    assert passed[-1].t == pytest.approx(t[-1] - BaroScreen.HOLD)


@given(st.floats(5.0, 200.0), st.floats(0.05, 2.0), st.booleans())
def test_nothing_within_half_a_second_of_a_jump_passes(size, lasts, falls):
    t = np.arange(0.0, 10.0, 0.1)
    glitch = (t >= 5.0) & (t < 5.0 + lasts)
    altitude = np.where(glitch, -size if falls else size, 0.0)
    screen = BaroScreen(0.2)
    passed = [s for t_, a in zip(t, altitude, strict=True) for s in screen.pass_on(BaroSample(t_, 1e5, 288.0, a))]
    jumps = t[np.flatnonzero(np.diff(altitude)) + 1]
    assert all(min(abs(s.t - jump) for jump in jumps) > BaroScreen.HOLD - 0.11 for s in passed)
    # a step that stays is heard again: the filter has a bias for it
    if not 0.9 < lasts < 1.3:
        assert any(s.altitude != 0.0 for s in passed) == (lasts > 1.0)


def test_echoes_pass_while_they_move_with_the_barometer():
    screen, rng = SonarScreen(0.1), np.random.default_rng(1)
    for k in range(40):
        t, height = 0.1 * k, 0.3 * k
        screen.baro(height + 2.0)
        assert screen.passes(t, height + rng.normal(0.0, 0.05)) == (k >= 3)
    passed = 0
    for k in range(40, 80):  # it climbs on, the echoes are from anywhere
        screen.baro(0.3 * k + 2.0)
        passed += screen.passes(0.1 * k, rng.uniform(1.0, 6.0))
    assert passed <= 2


# --- without inertial samples -----------------------------------------------------------------------------------------


def test_its_standard_deviations_are_honest(nominal):
    """Random flights of the assumed acceleration, sensors with the assumed errors: NEES of height and climb rate."""
    rng = np.random.default_rng(7)
    quiet = fit({"baro": baro([0.0, 0.1], [0.0, 0.0]), "gps": gps([0.0, 0.2])}, nominal)
    noise = quiet.sensors["baro"]["noise"], quiet.sensors["gps"]["noise_up"]
    drift, wander = quiet.sensors["baro"]["drift_std"], quiet.sensors["gps"]["wander_std_up"]
    scores = []
    for _ in range(30):
        filter_ = KinematicNavigator(quiet, 0.0, period=0.05, acceleration=1.0)
        h, v = rng.normal(0.0, 5.0), 0.0
        b_q, b_g = rng.normal(0.0, drift), rng.normal(0.0, wander)
        for k in range(1, 400):
            h += 0.05 * v
            v += rng.normal(0.0, math.sqrt(0.05))
            b_q += rng.normal(0.0, drift * math.sqrt(2.0 * 0.05 / 60.0))
            b_g += rng.normal(0.0, wander * math.sqrt(2.0 * 0.05 / 60.0))
            t, batch = 0.05 * k, []
            if k % 2 == 0:
                batch.append(BaroSample(t, 1e5, 288.0, h + b_q + rng.normal(0.0, noise[0])))
            if k % 4 == 0:
                seen = h + b_g + rng.normal(0.0, noise[1])
                batch.append(GpsSample(t, t, 0.0, 0.0, seen, math.nan, math.nan, math.nan, 9, math.nan, True))
            state = filter_.update(batch)
        scores.append(((state.position[2] - h) / state.std_position[2]) ** 2)
        scores.append(((state.velocity[2] - v) / state.std_velocity[2]) ** 2)
    # 99.9 % of the mean of 60 chi-square variables; the barometer's half second of quarantine costs a little
    assert 0.5 < np.mean(scores) < 1.75


def test_a_leaning_ranger_means_less_height(nominal):
    equipment = fit({"sonar": table("measured", "sonar", [(0.1 * k, 2.0, True) for k in range(20)])}, nominal)
    t = np.arange(0.0, 4.0, 0.1)
    lean = np.full(len(t), math.radians(40.0))
    attitude = Angles(t, lean, np.zeros(len(t)), np.zeros(len(t)))
    heights = []
    for angles in (None, attitude):  # the ranger alone: no other height says that it is in reach
        filter_ = KinematicNavigator(equipment, 0.0, period=0.1, acceleration=1.0, attitude=angles)
        for k in range(1, 40):
            state = filter_.update([SonarSample(0.1 * k, 1.9, True)])
        heights.append(state.position[2])
    beam = equipment.sensors["sonar"]["beam_half_angle"]
    assert heights[0] == pytest.approx(1.9, abs=0.05)
    assert heights[1] == pytest.approx(1.9 * math.cos(math.radians(40.0) - beam), abs=0.05)


def test_an_old_attitude_is_none():
    angles = Angles(np.array([0.0, 1.0]), np.array([0.1, 0.2]), np.zeros(2), np.zeros(2))
    assert angles.at(1.5)[0] == 0.2
    assert math.isnan(angles.at(2.5)[0]) and math.isnan(angles.at(-0.1)[0])


# --- with them --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [25.0, 250.0])
def test_slow_and_fast_inertial_sensors(nominal, rate):
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 10.0, 1.0 / rate) + 1000.0
    late = np.arange(1000.0, 1010.0, 0.1)
    tables = {"imu": imu(t, rng), "baro": baro(late, rng.normal(0.0, 0.1, len(late))), "gps": gps(late[::2])}
    equipment = fit(tables, nominal)
    found = run([tables], equipment, lambda: navigators.make("helideck", equipment, sees=False))
    own = found.estimate
    assert found.inertial and found.used == ("imu", "baro", "gps")
    assert sum(found.rejected.values()) <= 2
    assert own["t"][0] == t[0] and own["t"][-1] > t[-1] - 0.05
    assert np.diff(own["t"]).min() > 0.5 / 50.0
    assert np.abs(own["u"][len(own) // 2 :]).max() < 0.5


def test_a_long_pause_begins_anew_and_a_short_one_is_crossed(nominal):
    rng = np.random.default_rng(2)
    first, short, long = np.arange(0.0, 3.0, 0.02), np.arange(5.0, 8.0, 0.02), np.arange(100.0, 103.0, 0.02)
    tables = {"imu": imu(np.concatenate([first, short, long]), rng), "gps": gps(np.arange(0.0, 103.0, 0.2))}
    equipment = fit(tables, nominal)
    made = []

    def make():
        made.append(navigators.make("helideck", equipment, sees=False))
        return made[-1]

    t = run([tables], equipment, make).estimate["t"]
    assert len(made) == 2
    assert np.any((t > 3.1) & (t < 4.9))  # on through the short pause
    assert not np.any((t > 8.1) & (t < 99.9))


def test_samples_come_in_the_order_of_their_arrival(nominal):
    tables = {"imu": imu(np.arange(0.0, 1.0, 0.02), np.random.default_rng(0)), "gps": gps([0.0, 0.2, 0.4])}
    found = list(arrivals(tables, nominal))
    times = [t for t, _ in found]
    assert times == sorted(times) and len(found) == 53
    fixes = [(t, sample) for t, sample in found if isinstance(sample, GpsSample)]
    late = nominal.sensors["gps"].latency
    assert [t for t, _ in fixes] == pytest.approx([late, 0.2 + late, 0.4 + late])
    assert all(sample.t_arrival == t for t, sample in fixes)
    assert all(t == sample.t for t, sample in found if isinstance(sample, ImuSample))
