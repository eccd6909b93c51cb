"""All filters together on synthetic flights with every sensor's faults."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from estimators.altitude import Mode
from estimators.eyes import Eyes
from estimators.navigator import Navigator
from estimators.vision.sighting import PadPrediction, PadSighting
from flightlog.equipment import Equipment
from flightlog.rotations import angles, matrix, wrap
from flightlog.signals import (
    BaroSample,
    Frame,
    GpsSample,
    HorizonSample,
    ImuSample,
    MagSample,
    PadSample,
    RotorSample,
    SonarSample,
    StateEstimate,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Track:
    """A flight as estimated, and what was true."""

    navigator: Navigator
    states: list[StateEstimate]
    t: Floats
    position: Floats  # (N, 3) error [m]
    velocity: Floats  # (N, 3) error [m/s]
    attitude: Floats  # (N, 3) error of roll, pitch, heading [rad]
    std_position: Floats  # (N, 3)
    std_velocity: Floats
    std_attitude: Floats

    def after(self, begin: float, end: float = math.inf) -> NDArray[np.bool_]:
        return (self.t >= begin) & (self.t < end)


def follow(flight, equipment: Equipment, **options) -> Track:
    navigator = Navigator(equipment, **options)
    states = [navigator.update(update) for update in flight.updates]
    t = flight.t
    truth = np.column_stack(flight.motion.angles(t))
    got = np.array([[s.roll, s.pitch, s.heading] for s in states])
    return Track(
        navigator, states, t,
        np.array([s.position for s in states]) - flight.motion.position(t),
        np.array([s.velocity for s in states]) - flight.motion.position(t, 1),
        (got - truth + np.pi) % (2 * np.pi) - np.pi,
        *(np.array([getattr(s, f"std_{name}") for s in states]) for name in ("position", "velocity", "attitude")),
    )  # fmt: skip


def rms(errors: Floats) -> Floats:
    return np.sqrt(np.mean(np.square(errors), axis=0))


@pytest.fixture(scope="module")
def hovers(synthetic, equipment: Equipment) -> list[Track]:
    return [follow(synthetic.fly(seed, synthetic.Recipe(duration=30.0)), equipment) for seed in range(6)]


@pytest.fixture(scope="module")
def landings(synthetic, equipment: Equipment) -> list[Track]:
    recipe = synthetic.Recipe(duration=25.0, descend=(5.0, 24.0))
    return [follow(synthetic.fly(seed, recipe), equipment) for seed in range(6)]


def test_level_within_three_tenths_of_a_degree(hovers: list[Track], landings: list[Track]) -> None:
    for flights in (hovers, landings):
        tilt = np.array([rms(track.attitude[track.after(3.0), :2]) for track in flights])
        assert np.degrees(rms(tilt.ravel())) < 0.3
        heading = np.array([rms(track.attitude[track.after(3.0), 2]) for track in flights])
        assert np.degrees(rms(heading)) < 0.3


def test_hover_is_known_to_centimetres(hovers: list[Track]) -> None:
    for track in hovers:
        settled = track.after(3.0)
        assert np.all(rms(track.position[settled]) < [0.12, 0.12, 0.02])
        assert np.all(rms(track.velocity[settled]) < [0.05, 0.05, 0.02])
        assert np.all(np.abs(track.position[settled, 2]) < 0.05)


def test_touchdown_is_known_to_centimetres_after_coasting(landings: list[Track]) -> None:
    for track in landings:
        assert track.states[-1].pad_age > 1.0, "the mark was lost on the way"
        assert track.navigator.mode is Mode.NEAR
        assert np.all(np.abs(track.position[-1, :2]) < 3.5 * track.std_position[-1, :2])
        assert abs(track.position[-1, 2]) < 0.01
    assert rms(np.array([np.hypot(*track.position[-1, :2]) for track in landings])) < 0.10


def test_good_sensors_lose_nothing(hovers: list[Track], landings: list[Track]) -> None:
    for track in hovers + landings:
        assert not track.navigator.rejected


def test_rates_and_acceleration_are_handed_on_without_the_vibration(synthetic, equipment: Equipment) -> None:
    flight = synthetic.fly(1, synthetic.Recipe(duration=15.0))
    track = follow(flight, equipment)
    late = track.after(3.0)
    rates = np.array([s.rates for s in track.states])[late] - flight.motion.rates(flight.t)[late]
    assert np.all(rms(rates) < 0.01)  # 0.02 at once and twice a turn is put in
    acceleration = np.array([s.acceleration for s in track.states])[late] - flight.motion.position(flight.t, 2)[late]
    assert np.all(rms(acceleration) < 0.1)  # 1.5 m/s^2 is put in


# consistency over 30 flights, at times far enough apart; 99.9 % bands of chi-square


def nees(error: Floats, covariance: Floats) -> float:
    return float(error @ np.linalg.solve(covariance, error))


@pytest.fixture(scope="module")
def ensemble(synthetic, equipment: Equipment) -> dict[str, dict[str, Floats]]:
    """NEES (30, times) by quantity, with GPS alone and with vision."""
    times = [250, 1000, 2000, 2999]
    rows: dict[str, dict[str, list[list[float]]]] = {
        case: {"side": [], "up": [], "tilt": [], "heading": []} for case in ("gps", "vision")
    }
    for seed in range(30):
        whole = synthetic.fly(100 + seed, synthetic.Recipe(duration=12.0))
        for case, flight in (("gps", whole.drop(PadSample)), ("vision", whole)):
            for quantity, values in judged(flight, Navigator(equipment), times).items():
                rows[case][quantity].append(values)
    return {case: {key: np.array(values) for key, values in found.items()} for case, found in rows.items()}


def judged(flight, navigator: Navigator, times: list[int]) -> dict[str, list[float]]:
    """NEES at some updates of one flight."""
    found: dict[str, list[float]] = {"side": [], "up": [], "tilt": [], "heading": []}
    for i, update in enumerate(flight.updates):
        s = navigator.update(update)
        if i not in times:
            continue
        side, up = navigator._position.kalman.last, navigator._altitude.kalman.last
        p, v = flight.motion.position(flight.t[i]), flight.motion.position(flight.t[i], 1)
        e = np.concatenate([s.position[:2] - p[:2], s.velocity[:2] - v[:2]])
        found["side"].append(nees(e, side["p"][:4, :4]))
        found["up"].append(nees(np.array([s.position[2] - p[2], s.velocity[2] - v[2]]), up["p"][:2, :2]))
        roll, pitch, heading = flight.motion.angles(flight.t[i])
        tilt = np.array([s.roll - roll, s.pitch - pitch])
        found["tilt"].append(nees(tilt, np.diag(s.std_attitude[:2] ** 2)))
        found["heading"].append(float(wrap(s.heading - heading) / s.std_attitude[2]) ** 2)
    return found


def band(degrees: int, runs: int = 30) -> tuple[float, float]:
    low, high = chi2.ppf([0.0005, 0.9995], degrees * runs) / runs
    return float(low), float(high)


@pytest.mark.parametrize(("quantity", "degrees"), [("side", 4), ("up", 2)])
def test_with_gps_alone_errors_are_as_large_as_they_are_said_to_be(ensemble, quantity: str, degrees: int) -> None:
    low, high = band(degrees)
    mean = ensemble["gps"][quantity].mean(axis=0)
    assert np.all((mean > low) & (mean < high)), mean


@pytest.mark.parametrize(("quantity", "degrees"), [("side", 4), ("up", 2), ("tilt", 2), ("heading", 1)])
def test_errors_are_never_larger_than_they_are_said_to_be(ensemble, quantity: str, degrees: int) -> None:
    """With vision the filter allows for errors of focal length and mount, which these flights do not have."""
    for case in ensemble.values():
        assert np.all(case[quantity].mean(axis=0) < band(degrees)[1])


# what goes missing


DROPPED = {
    "mag": MagSample, "baro": BaroSample, "gps": GpsSample, "sonar": SonarSample, "rotor": RotorSample,
    "pad": PadSample, "imu": ImuSample,
}  # fmt: skip


@pytest.mark.parametrize("topic", DROPPED)
def test_a_dropped_sensor_makes_the_state_less_sure_and_nothing_else(
    synthetic, equipment: Equipment, topic: str
) -> None:
    begin, end = 8.0, 9.0 if topic == "imu" else 14.0
    whole = synthetic.fly(3, synthetic.Recipe(duration=20.0, vibration=0.5))
    full, lacking = follow(whole, equipment), follow(whole.drop(DROPPED[topic], begin, end), equipment)
    gap = lacking.after(begin, end)
    for std in ("std_position", "std_velocity"):
        assert np.all(getattr(lacking, std)[gap] > getattr(full, std)[gap] * 0.97)
    # what is found of the tilt and not yet turned back is in this one
    assert np.all(lacking.std_attitude[gap].mean(axis=0) > full.std_attitude[gap].mean(axis=0) * 0.95)
    for error, std in (("position", "std_position"), ("velocity", "std_velocity"), ("attitude", "std_attitude")):
        late = lacking.after(2.0)
        assert np.all(np.abs(getattr(lacking, error)[late]) < 4.5 * getattr(lacking, std)[late] + 0.01)
    # and afterwards all is as before
    assert np.all(rms(lacking.position[lacking.after(18.0)]) < [0.15, 0.15, 0.02])


@pytest.mark.parametrize("topic", DROPPED)
def test_a_sensor_that_never_speaks_is_done_without(synthetic, equipment: Equipment, topic: str) -> None:
    track = follow(synthetic.fly(4, synthetic.Recipe(duration=5.0)).drop(DROPPED[topic]), equipment)
    last = track.states[-1]
    assert np.all(np.isfinite([*last.position, *last.velocity, *last.quaternion, *last.std_position]))
    assert last.t == pytest.approx(track.t[-1], abs=0.005)
    late = track.after(2.0)
    if topic == "mag":  # the mark's axis tells the heading but for half a turn: no position can be had, and it says so
        assert np.all(track.std_attitude[late, 2] > 1.0)
        assert np.all(np.abs(track.position[late, 2]) < 4.5 * track.std_position[late, 2] + 0.01)
    else:
        assert np.all(np.abs(track.position[late]) < 4.5 * track.std_position[late] + 0.01)


def test_the_barometer_alone_gives_the_height_of_the_body_not_of_its_port(synthetic, equipment: Equipment) -> None:
    flight = synthetic.fly(2, synthetic.Recipe(duration=6.0, errors=0.0, vibration=0.0))
    for kind in (PadSample, GpsSample, SonarSample):
        flight = flight.drop(kind)
    track = follow(flight, equipment)
    assert np.abs(track.position[track.after(2.0), 2]).max() < 0.02


def test_nothing_at_all_gives_a_state_that_knows_nothing(equipment: Equipment) -> None:
    navigator = Navigator(equipment)
    for _ in range(500):
        state = navigator.update([])
    assert state.std_position.min() > 10.0
    assert math.isinf(state.pad_age) and math.isinf(state.height_age)


def test_the_mark_s_loss_moves_nothing(synthetic, equipment: Equipment) -> None:
    flight = synthetic.fly(5, synthetic.Recipe(duration=20.0)).drop(PadSample, 12.0)
    track = follow(flight, equipment)
    before = track.position[track.after(11.0, 12.0)].mean(axis=0)
    gap = track.position[track.after(12.0, 17.0)] - before
    assert np.abs(gap[:, :2]).max() < 0.2  # the GPS is half a metre off
    assert np.abs(np.diff(gap, axis=0)).max() < 0.05
    ages = np.array([s.pad_age for s in track.states])
    assert ages[-1] == pytest.approx(8.0, abs=0.11)
    assert math.isinf(ages[0])


# what comes in badly


def test_order_repetition_and_delay_within_a_call_do_not_matter(synthetic, equipment: Equipment) -> None:
    flight = synthetic.fly(6, synthetic.Recipe(duration=4.0))
    once = follow(flight, equipment)
    late = Navigator(equipment)
    held: list = []
    rng = np.random.default_rng(0)
    for update in flight.updates:
        now, later = [], []
        for s in update:
            # pictures come up to 0.1 s later still, out of order, and some twice
            (later if type(s) is PadSample and rng.random() < 0.6 else now).append(s)
        held = [*held, *later]
        due = [s for s in held if rng.random() < 0.1]
        held = [s for s in held if s not in due]
        state = late.update([*now, *due, *(s for s in due if rng.random() < 0.3)])
    state = late.update([*held])
    expected = once.navigator.update([])
    np.testing.assert_allclose(state.position, expected.position, atol=0.02)
    np.testing.assert_allclose(state.velocity, expected.velocity, atol=0.02)
    assert set(late.rejected) <= {"pad"}


@pytest.mark.parametrize("kind", [k for t, k in DROPPED.items()])
def test_values_that_are_not_finite_are_counted_and_leave_no_trace(synthetic, equipment: Equipment, kind: type) -> None:
    flight = synthetic.fly(7, synthetic.Recipe(duration=6.0))
    field = kind._fields[1 if kind not in (GpsSample, PadSample) else 2]
    rng = np.random.default_rng(1)

    def spoil(s):
        return s._replace(**{field: math.nan if rng.random() < 0.5 else math.inf}) if rng.random() < 0.1 else s

    if kind is BaroSample:
        field = "altitude"
    spoiled = flight.change(kind, spoil)
    if kind is SonarSample:
        spoiled = spoiled.change(kind, lambda s: s._replace(valid=True))
    track = follow(spoiled, equipment)
    topic = next(t for t, k in DROPPED.items() if k is kind)
    assert track.navigator.rejected[topic] > 0
    assert np.all(np.isfinite(track.position)) and np.all(np.isfinite(track.attitude))
    assert np.all(np.abs(track.position[track.after(3.0)]) < [0.2, 0.2, 0.05])


def test_stamps_from_the_past_and_the_future_are_refused(synthetic, equipment: Equipment) -> None:
    flight = synthetic.fly(8, synthetic.Recipe(duration=4.0))
    navigator = Navigator(equipment)
    for update in flight.updates:
        navigator.update(update)
    before = dict(navigator.rejected)
    now = flight.t[-1]
    for shift in (-3.0, 0.5):
        t = now + shift
        navigator.update(
            [
                BaroSample(t, 1e5, 288.0, 50.0),
                GpsSample(t, t, 50.0, 50.0, 50.0, 0.0, 0.0, 0.0, 9, 1.0, True),
                PadSample(t, t, 5.0, 5.0, 5.0, 0.0, 0.01, 0.01, 0.01, 0.01, 1.0, "test"),
            ]
        )
    state = navigator.update([ImuSample(now - 1.0, 50.0, 0.0, 0.0, 1.0, 0.0, 0.0)])
    rejected = {topic: count - before.get(topic, 0) for topic, count in navigator.rejected.items()}
    assert rejected == {"baro": 2, "gps": 2, "pad": 2, "imu": 1}
    assert np.abs(state.position - flight.motion.position(now)).max() < 0.2


def test_a_receiver_that_is_known_to_be_very_late_is_waited_for(synthetic, equipment: Equipment) -> None:
    gps = equipment.sensors["gps"]
    slow = replace(equipment, sensors={**equipment.sensors, "gps": replace(gps, latency=1.0)})
    recipe = synthetic.Recipe(duration=8.0, latency={"gps": 1.0, "pad": 0.06})
    track = follow(synthetic.fly(14, recipe).drop(PadSample), slow)
    assert not track.navigator.rejected
    late = track.after(4.0)
    assert np.all(np.abs(track.position[late]) < 4.5 * track.std_position[late])


def test_a_wild_picture_is_rejected_and_counted(synthetic, equipment: Equipment) -> None:
    flight = synthetic.fly(9, synthetic.Recipe(duration=8.0))
    wild = flight.change(PadSample, lambda s: s._replace(x=s.x + 3.0) if 5.0 < s.t < 5.5 else s)
    track = follow(wild, equipment)
    assert track.navigator.rejected["pad"] >= 10
    assert np.abs(track.position[track.after(3.0)]).max() < 0.2


def test_an_invalid_fix_and_an_invalid_echo_are_no_measurement(synthetic, equipment: Equipment) -> None:
    flight = synthetic.fly(10, synthetic.Recipe(duration=5.0))
    invalid = flight.change(GpsSample, lambda s: s._replace(valid=False, e=80.0))
    track = follow(invalid, equipment)
    assert track.navigator.rejected["gps"] > 10
    assert np.abs(track.position[track.after(2.0)]).max() < 0.3


def test_the_same_samples_give_the_same_states_to_the_last_bit(synthetic, equipment: Equipment) -> None:
    flight = synthetic.fly(11, synthetic.Recipe(duration=3.0))
    first, second = follow(flight, equipment), follow(flight, equipment)
    np.testing.assert_array_equal(first.position, second.position)
    np.testing.assert_array_equal(first.std_attitude, second.std_attitude)


def test_states_handed_out_stay_as_they_were(synthetic, equipment: Equipment) -> None:
    flight = synthetic.fly(12, synthetic.Recipe(duration=1.0))
    navigator = Navigator(equipment)
    early = navigator.update(flight.updates[0])
    kept = early.position.copy(), early.quaternion.copy()
    for update in flight.updates[1:]:
        navigator.update(update)
    np.testing.assert_array_equal(early.position, kept[0])
    np.testing.assert_array_equal(early.quaternion, kept[1])


def test_a_horizon_is_taken_without_harm(equipment: Equipment) -> None:
    navigator = Navigator(equipment)
    state = navigator.update([ImuSample(0.0, 0.0, 0.0, 9.8, 0.0, 0.0, 0.0), HorizonSample(0, 0, 0, 0, 1, 1, True)])
    assert state.t == 0.0


# pictures


class Eye:
    """A front end that sees the pad where it truly is, and keeps what it was told to expect."""

    def __init__(self, flight, equipment: Equipment) -> None:
        self.flight, self.mount = flight, equipment.cameras["down"].mount
        self.told: list[tuple[float, PadPrediction | None, Floats]] = []

    def see(self, image: NDArray[np.uint8], attitude: Floats, prediction: PadPrediction | None) -> PadSighting | None:
        t = float(image.view(np.float64).ravel()[0])
        rotation = self.flight.motion.rotation(t).as_matrix()
        at = self.mount.axes.T @ (-rotation.T @ self.flight.motion.position(t) - self.mount.position)
        heading = float(self.flight.motion.angles(t)[2])
        angle = math.pi / 2 - (math.pi / 2 + heading) % math.pi
        self.told.append((t, prediction, np.append(at, angle)))
        if 4.0 <= t < 5.0:
            return None
        std = np.array([0.003, 0.003, 0.003])
        return PadSighting(
            at, angle, std, 0.002, np.diag([*std**2, 0.002**2]), 1.0, 1.0, np.zeros((12, 2)), "tracked",
            rotation.T[2], 0.1, 100.0,
        )  # fmt: skip


def test_pictures_are_seen_with_a_prediction_that_holds(synthetic, equipment: Equipment) -> None:
    flight = synthetic.fly(13, synthetic.Recipe(duration=8.0))

    def picture(s):
        image = np.array([s.t]).view(np.uint8).reshape(1, 8)
        return Frame(s.t, s.t_arrival, "down", image)

    frames = flight.change(PadSample, picture)
    eye = Eye(flight, equipment)
    navigator = Navigator(equipment, Eyes(pad=eye))
    seen, drawn = 0, []
    for update in frames.updates:
        navigator.update(update)
        seen += len(navigator.detections)
        drawn.append(len(navigator.overlays.get("down", ())))
    state = navigator.update([])
    assert np.abs(state.position - flight.motion.position(8.0)).max() < 0.15
    assert seen == sum(1 for t, _, _ in eye.told if not 4.0 <= t < 5.0)
    assert drawn[-1] == 1 and 0 in drawn[1100:1300]
    judged = [(p, truth) for t, p, truth in eye.told if t > 1.0 and p is not None]
    assert len(judged) > 150
    errors = np.array([p.position - truth[:3] for p, truth in judged])
    stds = np.array([p.std_position for p, _ in judged])
    assert np.all(np.abs(errors) < 5.0 * stds + 0.01)
    turned = np.array([wrap(2 * (p.angle - truth[3])) / 2 for p, truth in judged])
    assert np.degrees(np.abs(turned)).max() < 1.0


def test_attitude_of_the_state_is_one(hovers: list[Track]) -> None:
    """Angles and quaternion say the same, and body z is up to a trim."""
    state = hovers[0].states[-1]
    np.testing.assert_allclose(angles(state.quaternion), [state.roll, state.pitch, state.heading], atol=1e-12)
    assert matrix(state.quaternion)[2, 2] > 0.98
