"""How a flight is prepared: noise levels, lags, the attitude at its start, errors of sensors taken out beforehand."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from flightlog.rotations import angles
from identification import about
from identification import kinematics as k
from identification.barometer import lagged
from identification.causes import CATALOGUE
from identification.drive import Noise
from identification.evidence import DRIVEN, INFLOW, Sheet
from identification.flight import Flight, prepare
from identification.helicopter import HelicopterBench, caution
from identification.model import Model
from identification.white_noise import noise_factors
from sim.vehicle import Vehicle, load
from tests.identification.short_flight import Columns, copied, made_table

Floats = NDArray[np.float64]


@pytest.fixture(scope="module")
def raptor() -> Vehicle:
    return load("raptor90")


def prepared(columns: Columns, vehicle: Vehicle) -> Flight:
    return prepare("flight", {topic: made_table(topic, found) for topic, found in columns.items()}, vehicle)


def level(flight: Flight, kind: int) -> float:
    """[unit] white noise that the filter settled on."""
    return float(np.median(flight.motion.stds[flight.motion.kinds == kind]))


@pytest.mark.parametrize("tau", [0.0, 0.02, 0.1, 0.5])
def test_a_lag_is_exact_for_a_ramp_and_leaves_what_stands_still(tau: float) -> None:
    t = np.asarray(0.04 * np.arange(500), float)
    late = 2.0 * t - lagged(2.0 * t, tau, 0.04)
    np.testing.assert_allclose(late, 2.0 * tau * (1.0 - np.exp(-t / tau) if tau else 0.0 * t), atol=1e-12)
    np.testing.assert_allclose(lagged(np.full(5, 3.0), tau, 0.04), 3.0)


def test_a_quiet_sensor_is_believed_where_its_noise_is_white_and_not_where_it_gives_running_means(
    flown: Columns, raptor: Vehicle
) -> None:
    declared, rng = raptor.sensors["baro"].numbers["noise"], np.random.default_rng(5)
    smooth = np.convolve(np.pad(flown["baro"]["altitude"], 200, mode="edge"), np.ones(50) / 50, "same")[200:-200]
    quiet, running = copied(flown), copied(flown)
    drawn = 0.3 * declared * rng.standard_normal(len(smooth) + 39)
    quiet["baro"]["altitude"] = smooth + drawn[39:]
    running["baro"]["altitude"] = smooth + np.convolve(drawn / 0.3, np.ones(40) / 40, "valid")
    assert level(prepared(quiet, raptor), k.BARO) < 0.5 * declared
    assert level(prepared(running, raptor), k.BARO) == pytest.approx(declared, rel=0.05)


def test_a_flight_that_begins_pushed_aside_begins_as_it_lies_and_not_as_its_force_says(
    flown: Columns, raptor: Vehicle
) -> None:
    sound = prepared(flown, raptor)
    pushed = copied(flown)
    early = pushed["imu"]["t"] < pushed["imu"]["t"][0] + 0.12  # what the start is levelled by
    pushed["imu"]["fx"] = np.where(early, pushed["imu"]["fx"] + 2.0, pushed["imu"]["fx"])
    found = prepared(pushed, raptor)
    error = np.degrees(np.array(angles(found.motion.attitude[5])) - np.array(angles(sound.motion.attitude[5])))
    assert math.degrees(2.0 / 9.81) > 11.0  # by which it would lie askew
    assert np.abs((error + 180.0) % 360.0 - 180.0).max() < 2.0


@pytest.fixture(scope="module")
def late(flown: Columns, raptor: Vehicle) -> HelicopterBench:
    """A flight whose marks are 60 ms late, with 50 ms of it taken out beforehand."""
    columns = copied(flown)
    columns["pad"]["t"] = columns["pad"]["t"] + 0.06
    tables = {topic: made_table(topic, found) for topic, found in columns.items()}
    return HelicopterBench({"flight": tables}, raptor, prepared_at={"cameras.down.stamp_delay": 0.05})


def test_errors_of_sensors_count_from_those_that_were_taken_out(late: HelicopterBench) -> None:
    key = "cameras.down.stamp_delay"
    assert late.errors({}) == pytest.approx({key: -0.05})
    assert late.errors({key: 0.06, "sensors.imu.bias_fx": 0.3, "mass": 5.0}) == pytest.approx(
        {key: 0.01, "sensors.imu.bias_fx": 0.3}
    )
    # the residual of a mark that was never late is that of one which is 50 ms early
    same, none = late.rows(0, {key: 0.05}), late.rows(0, {})
    at = none.channel == k.PAD
    moved = none.residual[at] - same.residual[at]
    np.testing.assert_allclose(moved, 0.05 * same.signatures[key][at], atol=1e-9 + 1e-6 * np.abs(moved).max())


def test_flights_are_filtered_anew_for_errors_that_were_not_taken_out_yet(late: HelicopterBench) -> None:
    latency, mass = CATALOGUE["camera_latency"], CATALOGUE["mass"]
    key, std = "cameras.down.stamp_delay", {"cameras.down.stamp_delay": 1e-3, "mass": 0.1}
    assert late.anew([latency], {key: 0.053}, std) is None
    assert late.settled([latency], {key: 0.06}, {key: 0.02}) and not late.settled([latency], {key: 0.06}, std)
    further = late.anew([latency], {key: 0.06}, std)
    assert further is not None and further.prepared_at == {key: pytest.approx(0.06)}
    assert late.settled([mass], {"mass": 5.2}, std)  # what was taken out may still be found by a larger set
    back = late.anew([mass], {"mass": 5.2}, std)
    assert back is not None and back.anew([latency], {key: 9.0}, std) is None
    assert back is not None and back.prepared_at == {} and back.anew([mass], {"mass": 5.2}, std) is None


def test_more_evidence_is_asked_for_where_the_wind_is_strong(late: HelicopterBench) -> None:
    assert late.caution == 1.0 and late.threshold == HelicopterBench.threshold
    calm, strong = np.array([3.0, -4.0, 0.0]), np.array([0.0, -13.0, 5.0])
    assert caution([calm], [1.5]) == 1.0 and caution([calm], [6.0]) == 3.0
    assert caution([calm, strong, calm], [1.0] * 3) == pytest.approx(256.0) == caution([3.0 * strong], [1.0])


def test_flights_are_prepared_anew_with_play_in_force_and_judged_without_it(late: HelicopterBench) -> None:
    play, width, release = CATALOGUE["actuator_deadband"], "terms.deadband.width", "terms.deadband.release"
    found, std = {width: 0.01, release: 1.0}, {width: 1e-5, release: 1e-3}
    stuck = late.anew([play], found, std)
    assert stuck is not None and stuck.in_force == found and stuck.prepared_at == {}
    assert stuck.settled([play], found, std) and not stuck.settled([play], {**found, width: 0.013}, std)
    none, there = stuck.rows(0, {}), stuck.rows(0, found)
    assert np.abs(none.residual - there.residual).max() > 1.0  # and yet none flew


@pytest.mark.parametrize(("key", "size"), [
    ("sensors.imu.bias_wx", 0.02), ("sensors.imu.misalignment_y", 0.03)
])  # fmt: skip
def test_what_the_model_meets_of_an_inertial_sensors_error_is_that_of_flights_filtered_without_it(
    flown: Columns, raptor: Vehicle, key: str, size: float
) -> None:
    """Rate that is read too much is measured, and the model answers it: both must come with their own sign."""
    causes = [CATALOGUE[name] for name in ("imu_bias", "imu_misalignment", "imu_scale")]
    parameter = next(p for cause in causes for p in cause.parameters if p.key == key)
    other = about.with_errors(raptor, {key: parameter.nominal + size}, {key: parameter.unit})
    sheets = [Sheet(Model(raptor), prepared(flown, vehicle), causes, []) for vehicle in (raptor, other)]
    for sheet in sheets:
        sheet.linearise()
        sheet.gust = sheets[0].gust
        sheet.whiten(Noise())
    model = sheets[0].channel >= DRIVEN
    moved = (sheets[0].residual({}) - sheets[1].residual({}))[model]
    expected = size * sheets[0].columns[key][model]
    assert np.linalg.norm(moved - expected) < 0.5 * np.linalg.norm(moved)
    for moment in range(3, 6):  # each by itself, where the error shows in it
        one, same = moved[moment::7], expected[moment::7]
        if np.linalg.norm(one) > 0.2 * np.linalg.norm(moved):
            assert one @ same > 0.9 * np.linalg.norm(one) * np.linalg.norm(same)


def test_a_vehicle_with_a_sensors_error_has_it_in_the_unit_of_its_file(raptor: Vehicle) -> None:
    changed = about.with_errors(raptor, {"sensors.imu.bias_wz": 0.01, "sensors.baro.lag": 0.4},
                                {"sensors.imu.bias_wz": "rad/s", "sensors.baro.lag": "s"})  # fmt: skip
    assert changed.sensors["imu"].numbers["bias_wz"] == pytest.approx(0.01)
    assert changed.sensors["baro"].numbers["lag"] == pytest.approx(0.4)
    assert about.number(changed, "sensors.baro.lag", "s", 0.0) == pytest.approx(0.4)
    assert about.number(raptor, "sensors.imu.bias_wz", "rad/s", 0.0) == 0.0
    assert raptor.sensors["baro"].numbers["lag"] == pytest.approx(0.1)


def test_what_a_ranger_says_on_the_ground_is_no_measure_of_its_noise() -> None:
    """A range that is told in steps is the same all the time there. Found in a picture: 2.4 deviations in flight."""
    rng, count = np.random.default_rng(9), 200
    kinds, flies = np.full(2 * count, k.SONAR), np.repeat([False, True], count)
    stds = np.full(2 * count, 0.002)
    innovations = np.where(flies, 0.002 * rng.standard_normal(2 * count), 0.0)
    answers = np.column_stack([innovations, stds, np.ones(2 * count)])
    assert noise_factors(kinds, flies, stds, answers, stds)[k.SONAR] == pytest.approx(1.0, abs=0.2)
    assert noise_factors(kinds, np.full(2 * count, True), stds, answers, stds)[k.SONAR] < 0.7


def test_the_inflow_s_mass_stays_where_its_tolerance_lets_it(late: HelicopterBench) -> None:
    knob = late.model.knobs[INFLOW]
    assert late.bounded(INFLOW, 0.05) == pytest.approx(knob.nominal - 3.0 * knob.tolerance)
    assert late.bounded(INFLOW, 0.9) == 0.9


def test_noise_is_taken_from_the_flight_and_not_from_the_ground(
    flown: Columns, raptor: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked_at: list[NDArray[np.bool_]] = []

    def seen(kinds: Floats, counts: NDArray[np.bool_], *others: Floats) -> Floats:
        looked_at.append(counts)
        return np.ones(k.KINDS)

    monkeypatch.setattr("identification.flight.noise_factors", seen)
    monkeypatch.setattr("identification.flight._touched", lambda height: np.arange(len(height)) < len(height) // 2)
    prepared(flown, raptor)
    for counts in looked_at:
        assert not counts[: int(0.45 * len(counts))].any() and counts[int(0.55 * len(counts)) :].all()
    assert looked_at
