"""A flight's folder: the same for the same seed, complete however the flight ends."""

import json
import math

import numpy as np
import pytest

from flightlog.errors import UserError
from flightlog.flight_json import read_flight_json
from flightlog.readers import read_flight
from flightlog.signals import Controls
from scenarios.crew import make_navigator, make_pilot
from scenarios.flight import fly
from scenarios.load import build, load
from sim.divergence import SimulationDiverged

MEASURED = {"imu", "mag", "baro", "gps", "sonar", "rotor", "pad", "controls", "estimate"}
TRUTH = {"state", "wind", "rotor", "contact", "errors"}


@pytest.fixture(scope="module")
def short():
    return load("landing", {"duration_s": 3.0})


@pytest.fixture(scope="module")
def flown(tmp_path_factory, short):
    """Three seconds of landing: seed 4 twice, seed 5 once."""
    folder = tmp_path_factory.mktemp("flights")
    seeds = {"first": 4, "again": 4, "other": 5}
    return {name: fly(short, seed=seed, cameras=False, folder=folder / name) for name, seed in seeds.items()}


def files(flight, group):
    return {path.stem: path.read_bytes() for path in (flight.folder / group).glob("*.parquet")}


def test_same_scenario_and_seed_give_the_same_tables_bit_for_bit(flown):
    for group, topics in (("measured", MEASURED), ("truth", TRUTH)):
        first, again, other = (files(flown[name], group) for name in ("first", "again", "other"))
        assert set(first) == set(again) == topics
        assert [topic for topic in topics if first[topic] != again[topic]] == []
        assert [topic for topic in topics - {"contact"} if first[topic] == other[topic]] == []
    assert flown["first"].summary == flown["again"].summary
    assert flown["first"].summary != flown["other"].summary


def test_the_folder_holds_what_the_log_promises(flown, short):
    folder = flown["first"].folder
    document = read_flight_json(folder)
    assert document["scenario"]["duration_s"] == 3.0 and document["seed"] == 4
    assert document["vehicle"]["mass"]["value"] == 5.0
    assert document["versions"]["mujoco"]
    assert document["summary"]["summary"]["reason"] == "time is up"
    assert (folder / "replay.rrd").stat().st_size > 10_000
    assert not list(folder.rglob("*.arrows")) and not list(folder.rglob("*.part"))
    flight = read_flight(folder)
    assert flight.notes == []
    state = flight.truth["state"]
    assert np.diff(state["t"]).max() <= 0.01 + 1e-9  # at least 100 Hz
    assert state["t"][-1] == pytest.approx(3.0, abs=0.02)
    assert flight.measured["imu"].unit("fx") == "m/s^2"
    controls = flight.measured["controls"]
    assert len(controls) == 750 and controls["t"][0] == 0.0


def test_the_summary_is_what_the_tables_say(flown):
    """Computed again from the log by other means."""
    flight, s = read_flight(flown["first"].folder), flown["first"].summary
    state, fused = flight.truth["state"], flight.measured["estimate"]
    u = np.interp(fused["t"], state["t"], state["u"])
    flying = fused["t"] >= 0.5
    error = (fused["u"] - u)[flying]
    assert s.fused_height_mean_error_m == pytest.approx(np.abs(error).mean(), rel=0.02)
    assert s.fused_height_max_error_m == pytest.approx(np.abs(error).max(), rel=0.02)
    assert s.fused_height_std_m == pytest.approx(error.std(), rel=0.02)
    baro = flight.measured["baro"]
    off = (baro["altitude"] - np.interp(baro["t"], state["t"], state["u"]))[baro["t"] >= 0.5]
    assert s.sensor_height_error_m["baro"]["mean"] == pytest.approx(np.abs(off).mean(), rel=0.1)
    assert s.duration_s == pytest.approx(3.0)
    assert s.max_roll_deg is None or s.max_roll_deg < 10.0


def test_a_folder_in_use_is_refused_and_left_alone(flown, short):
    folder = flown["other"].folder
    before = sorted(path.name for path in folder.rglob("*"))
    with pytest.raises(UserError, match="not empty; name a folder that is new or empty"):
        fly(short, cameras=False, folder=folder)
    assert sorted(path.name for path in folder.rglob("*")) == before


# --- flights that are broken off --------------------------------------------------------------------------------------


def breaking(make, at, end):
    """A maker of crew whose update ends the flight at a time."""

    def maker(*arguments):
        made = make(*arguments)
        update, calls = made.update, [0]

        def turn(argument):
            calls[0] += 1
            if calls[0] > at * 250:
                return end(update(argument))
            return update(argument)

        made.update = turn
        return made

    return maker


def raising(error):
    def end(_):
        raise error

    return end


@pytest.mark.parametrize(
    ("crew", "error", "reason"),
    [
        ({"pilot": breaking(make_pilot, 1.0, raising(KeyboardInterrupt()))}, KeyboardInterrupt, "interrupted"),
        ({"pilot": breaking(make_pilot, 1.0, raising(ZeroDivisionError("mine")))}, ZeroDivisionError, "mine"),
        ({"navigator": breaking(make_navigator, 1.5, raising(RuntimeError("lost")))}, RuntimeError, "lost"),
        (
            {"pilot": breaking(make_pilot, 1.0, lambda sent: sent._replace(tail=math.nan))},
            SimulationDiverged, "control 'tail', which the pilot sent as nan",
        ),
    ],
    ids=["interrupted", "pilot", "navigator", "diverged"],
)  # fmt: skip
def test_whatever_ends_a_flight_its_log_is_kept(tmp_path, short, crew, error, reason):
    with pytest.raises(error):
        fly(short, cameras=False, folder=tmp_path / "flight", **crew)
    document = read_flight_json(tmp_path / "flight")
    assert reason in document["summary"]["summary"]["reason"]
    assert document["summary"]["summary"]["success"] is False
    flight = read_flight(tmp_path / "flight")
    assert set(flight.measured) == MEASURED and set(flight.truth) == TRUTH
    assert flight.measured["imu"]["t"][-1] == pytest.approx(1.5, abs=0.02)
    assert flight.notes == []
    assert (tmp_path / "flight" / "replay.rrd").stat().st_size > 10_000


def test_a_flight_that_ends_before_the_pilot_takes_over_is_summed_up_too(tmp_path, short):
    with pytest.raises(RuntimeError):
        fly(short, cameras=False, folder=tmp_path / "flight",
            navigator=breaking(make_navigator, 0.0, raising(RuntimeError("at once"))))  # fmt: skip
    summary = read_flight_json(tmp_path / "flight")["summary"]["summary"]
    assert summary["reason"] == "at once"
    assert summary["fused_height_mean_error_m"] is None
    json.dumps(summary, allow_nan=False)


def test_a_pilot_of_ones_own_flies(short):
    class Still:
        events, phase, finished = (), "still", False

        def __init__(self, vehicle, site, scenario, heading):
            self.scenario = scenario

        def update(self, state):
            return Controls(0.08, 0.0, 0.0, 0.0, 0.25)

        def set_target(self, east, north):
            pass

    summary = fly(load("landing", {"duration_s": 1.0}), cameras=False, pilot=Still).summary
    assert summary.reason == "time is up" and not summary.success


@pytest.mark.slow
@pytest.mark.render
def test_rendered_flights_are_the_same_bit_for_bit_too(tmp_path):
    scenario = load("landing", {"duration_s": 1.5, "start.position_m": [0.3, -0.2, 6.0]})
    flights = [fly(scenario, seed=2, folder=tmp_path / name, keep_frames=True) for name in ("first", "again")]
    first, again = (files(flight, "measured") for flight in flights)
    assert set(first) == set(again) == MEASURED | {"frames", "horizon"}
    assert [topic for topic in first if first[topic] != again[topic]] == []
    pictures = [sorted((flight.folder / "measured" / "frames").iterdir()) for flight in flights]
    assert [path.name for path in pictures[0]] == [path.name for path in pictures[1]]
    assert len(pictures[0]) > 45  # 25 and twice 10 a second, less what was still under way
    assert all(a.read_bytes() == b.read_bytes() for a, b in zip(*pictures, strict=True))
    assert len(read_flight(flights[0].folder).measured["pad"]) > 20


def test_a_landing_on_a_moved_target_is_judged_there() -> None:
    moved = {"at_s": 8.0, "kind": "target", "position_m": [0.6, -0.4]}
    summary = fly(build(events=[moved]), seed=3, cameras=False).summary
    assert summary.success
    assert summary.touchdown_east_m == pytest.approx(0.6, abs=0.2)
    assert summary.touchdown_north_m == pytest.approx(-0.4, abs=0.2)
