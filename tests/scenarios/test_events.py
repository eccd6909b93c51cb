"""What a scenario scripts happens when it is due, to whom it should, and for as long as it says."""

import numpy as np
import pytest

from flightlog.signals import BaroSample, GpsSample, PadSample
from scenarios.events import Script
from scenarios.load import build
from scenarios.staging import make_world
from sim import vehicle as vehicles


class Pilot:
    target = None

    def set_target(self, east, north):
        self.target = (east, north)


@pytest.fixture
def play():
    """Fly a script at trim for a time; world, pilot, what was said (t, text) and what was measured."""

    def flown(*events, seconds=1.0, seed=0, **tables):
        scenario = build(events=list(events), weather={"turbulence": "none", "wind_m_s": 1.0}, **tables)
        world = make_world(scenario, np.random.SeedSequence(seed), vehicles.load("raptor90"), cameras=False)
        script, pilot, said, samples = Script(scenario), Pilot(), [], []
        while world.t < seconds - 1e-9:
            said += [(world.t, text) for text in script.play(world, pilot)]
            world.step(world.trim.controls)
            samples += world.measure()
        return world, pilot, said, samples

    return flown


def of(samples, kind):
    return [sample for sample in samples if isinstance(sample, kind)]


def test_events_come_in_the_order_of_their_times(play):
    world, pilot, said, _ = play(
        {"at_s": 0.6, "kind": "target", "position_m": [1.0, 2.0]},
        {"at_s": 0.2, "kind": "light", "strength": 0.3},
        {"at_s": 0.2, "kind": "wind", "wind_m_s": 9.0, "wind_from_deg": 90.0},
        {"at_s": 5.0, "kind": "light", "strength": 2.0},
    )
    assert [t for t, _ in said] == pytest.approx([0.2, 0.2, 0.6])
    assert [text.split()[0] for _, text in said] == ["sun", "wind", "target"]
    assert pilot.target == (1.0, 2.0)
    assert world.light.strength == 0.3
    assert world.light.sun_elevation == pytest.approx(np.radians(45.0))  # what is not named stays
    assert world.truth.wind[0] < -7.0  # from the east


def test_a_gust_blows_for_its_time(play):
    gust = {"at_s": 0.2, "kind": "gust", "speed_m_s": 6.0, "from_deg": 270.0, "up_m_s": 1.0, "for_s": 0.4}
    during, _, said, _ = play(gust, seconds=0.4)
    after, *_ = play(gust, seconds=0.8)
    calm, *_ = play(seconds=0.4)
    assert during.truth.wind[0] - calm.truth.wind[0] == pytest.approx(6.0, rel=0.1)
    assert during.truth.wind[2] > 0.5
    assert abs(after.truth.wind[0] - calm.truth.wind[0]) < 0.2
    assert said[0][1] == "gust of 6 m/s from 270 deg for 0.4 s"


@pytest.mark.parametrize("sensor", ["gps", "baro", "pad"])
def test_a_dropout_silences_its_sensor_and_no_other(play, sensor):
    kinds = {"gps": GpsSample, "baro": BaroSample, "pad": PadSample}
    _, _, said, samples = play({"at_s": 0.3, "kind": "dropout", "sensor": sensor, "for_s": 0.4}, seconds=1.4)
    assert said[0][1] == f"{sensor} lost for 0.4 s"
    for name, kind in kinds.items():
        t = np.array([sample.t for sample in of(samples, kind)])
        lost = (t > 0.31) & (t < 0.69)
        assert lost.any() == (name != sensor), name
        assert (t < 0.3).any() and (t > 0.7).any(), name


def test_the_mark_is_lost_whichever_of_its_names_is_used(play):
    for name in ("down", "pad"):
        *_, samples = play({"at_s": 0.0, "kind": "dropout", "sensor": name, "for_s": 5.0}, seconds=0.6)
        assert not of(samples, PadSample)


def test_a_sensors_own_numbers_change_and_come_back(play):
    late = {"at_s": 0.3, "kind": "fault", "sensor": "gps", "numbers": {"latency_s": 0.05}, "for_s": 0.4}
    world, _, said, samples = play(late, seconds=1.5)
    t, latency = np.array([(s.t, s.t_arrival - s.t) for s in of(samples, GpsSample)]).T
    during = (t > 0.31) & (t < 0.69)
    assert latency[during] == pytest.approx(0.05)
    assert latency[~during] == pytest.approx(0.18)
    assert world.numbers("gps", ["latency"]) == {"latency": 0.18}
    assert said[0][1] == "fault of gps: latency_s = 0.05 for 0.4 s"


def test_faults_that_overlap_leave_the_sensor_sound(play):
    def late(at, latency, seconds):
        return {"at_s": at, "kind": "fault", "sensor": "gps", "numbers": {"latency_s": latency}, "for_s": seconds}

    first, second = late(0.1, 0.3, 0.5), late(0.3, 0.05, 0.6)  # 0.1 to 0.6 and 0.3 to 0.9
    for seconds, latency in ((0.2, 0.3), (0.5, 0.05), (0.8, 0.05), (1.0, 0.18)):
        world, *_ = play(first, second, seconds=seconds)
        assert world.numbers("gps", ["latency"]) == {"latency": latency}, seconds
    within = late(0.2, 0.05, 0.1)
    for seconds, latency in ((0.25, 0.05), (0.4, 0.3), (0.8, 0.18)):
        world, *_ = play(first, within, seconds=seconds)
        assert world.numbers("gps", ["latency"]) == {"latency": latency}, seconds


def test_a_short_dropout_within_a_long_one_does_not_end_it(play):
    spans = ((0.1, 0.6), (0.2, 0.1))
    lost = [{"at_s": at, "kind": "dropout", "sensor": "baro", "for_s": span} for at, span in spans]
    *_, samples = play(*lost, seconds=0.9)
    t = np.array([sample.t for sample in of(samples, BaroSample)])
    assert not ((t > 0.11) & (t < 0.69)).any() and (t > 0.7).any()


@pytest.mark.parametrize(
    ("fault", "size", "check"),
    [
        ("offset", 5.0, lambda t, d: d == pytest.approx(5.0)),
        ("ramp", 10.0, lambda t, d: d == pytest.approx(10.0 * (t - 0.3))),
        ("spike", 50.0, lambda t, d: np.count_nonzero(np.abs(d) > 0.5) > 3 and np.abs(d).max() <= 50.0),
        ("stuck", 0.0, lambda t, d: np.ptp(d) > 0.0),
    ],
)
def test_a_columns_fault_lasts_its_time(play, fault, size, check):
    event = {"at_s": 0.3, "kind": "fault", "sensor": "baro", "column": "altitude", "fault": fault, "size": size,
             "share": 0.5, "for_s": 0.4}  # fmt: skip
    broken, sound = (of(play(*events)[-1], BaroSample) for events in ((event,), ()))
    t = np.array([sample.t for sample in sound])
    difference = np.array([b.altitude - s.altitude for b, s in zip(broken, sound, strict=True)])
    during = (t > 0.301) & (t < 0.699)  # what was sampled with the event itself is still sound
    assert not difference[~during].any()
    assert check(t[during], difference[during])
    if fault == "stuck":
        assert len({sample.altitude for sample, hit in zip(broken, during, strict=True) if hit}) == 1
    assert all(b.pressure == s.pressure for b, s in zip(broken, sound, strict=True))


def test_the_scenarios_sensor_tables_replace_the_vehicles_numbers(play):
    world, *_ = play(seconds=0.1, sensors={"gps": {"latency_s": 0.4}, "baro": {"noise_m": 0.0}})
    assert world.numbers("gps", ["latency", "velocity_noise"]) == {"latency": 0.4, "velocity_noise": 0.05}
    assert world.numbers("baro", ["noise"]) == {"noise": 0.0}
