"""Effects that nobody foresaw: what they are found as, on rows made for it and on a flight."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pytest

from flightlog.tables import Table
from flightlog.topics import topic_of
from identification.bench import Baseline, Channel
from identification.diagnosis import examine
from identification.report import Findings, sentence
from identification.report.panels import unexplained
from identification.search import Search
from identification.stack import Rows
from identification.unknown import basis as basis_module
from identification.unknown import finding
from identification.unknown.bank import Columns, Way
from identification.unknown.drivers import Driver
from identification.unknown.finding import find
from identification.unknown.scoring import Moments, weigh
from identification.unknown.table import tables
from sim import terms
from sim import vehicle as vehicles
from sim.multirotor import load_multirotor
from sim.multirotor.simulate import fly
from sim.pipeline import Pipeline

NODES = 1500


def _wander(rng, memory):
    """(NODES,) a quantity that moves slowly, of size 1."""
    steps = np.convolve(rng.standard_normal(NODES + 4 * memory), np.hanning(memory), mode="same")
    moved = steps[2 * memory : 2 * memory + NODES]
    return (moved - moved.mean()) / moved.std()



@dataclass
class Plain:
    """A bench of two channels with white noise of 1, a bias each flight and one parameter that is a line in height."""

    missing: Mapping[str, object]  # by way: what is there beside noise, of (height, speed)
    seed: int
    flights: int = 2
    names: tuple[str, ...] = ("a", "b")
    causes: tuple[()] = ()
    not_testable: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    nominal: Mapping[str, float] = field(default_factory=lambda: {"slope": 0.0})
    units: Mapping[str, str] = field(default_factory=lambda: {"slope": "1"})
    tolerances: Mapping[str, float] = field(default_factory=lambda: {"slope": 0.02})
    spreads: Mapping[str, float] = field(default_factory=lambda: {"slope": 0.02})
    baseline: Baseline = field(default_factory=lambda: Baseline(True, None))
    vehicle: object = None

    def __post_init__(self):
        self.channels = {0: Channel("force_x", "m/s^2"), 1: Channel("sonar.range", "m")}
        self.ways = {c.name: Way(c.name, c.unit, c.name, c.name) for c in self.channels.values()}
        rng = np.random.default_rng(self.seed)
        self._along, self._residual = [], []
        for _ in range(self.flights):
            height = 0.4 + 6.0 * np.abs(_wander(rng, 200))
            speed = 4.0 * _wander(rng, 150)
            self._along.append({"height": Driver("m", height, 0.3), "speed": Driver("m/s", speed)})
            parts = [rng.standard_normal(NODES) + rng.normal(0.0, 3.0) for _ in self.channels]
            for i, channel in self.channels.items():
                if channel.name in self.missing:
                    parts[i] += self.missing[channel.name](height, speed)
            self._residual.append(np.concatenate(parts))

    def rows(self, flight: int, changes: Mapping[str, float], fresh: Collection[str] = ()) -> Rows:
        """White already."""
        slope = np.concatenate([self._along[flight]["height"].values, np.zeros(NODES)])
        local = np.kron(np.eye(2), np.ones((NODES, 1)))
        residual = self._residual[flight] - changes.get("slope", 0.0) * slope
        channel = np.repeat([0, 1], NODES)
        t = np.tile(0.04 * np.arange(NODES), 2)
        return Rows(residual, {"slope": slope}, local, np.array([10.0, 10.0]), channel, t)

    def bounded(self, key: str, value: float) -> float:
        """Free."""
        return value

    def bank(self) -> "Plain":
        """Itself."""
        return self

    def drivers(self, flight: int) -> Mapping[str, Driver]:
        """Height and speed."""
        return self._along[flight]

    def columns(self, flight: int, way: str, shapes: np.ndarray) -> Columns:
        """As they are."""
        number = list(self.ways).index(way)
        return Columns(slice(number * NODES, (number + 1) * NODES), shapes)


def _push(height, speed):
    return 2.5 * np.exp(-height / 0.8)


def _drag(height, speed):
    return -0.08 * speed * np.abs(speed)


def _looked(missing, seed, **more):
    bench = Plain(missing, seed, **more)
    return bench, find(Search(bench), ())


def _agreement(found, truth):
    """R^2 of the curve, up to a constant."""
    true = truth(found.x, found.x)
    left = (found.values - found.values.mean()) - (true - true.mean())
    return 1.0 - np.var(left) / np.var(true)


def test_where_nothing_is_wrong_nothing_is_found():
    best = []
    for seed in range(20):
        _, outcome = _looked({}, seed)
        assert not outcome.found
        best.append(max(w.nats for w in outcome.scanned.values()))
    assert max(best) < 6.0


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("channel", "truth", "driver"),
    [("force_x", _push, "height"), ("sonar.range", _push, "height"), ("force_x", _drag, "speed")],
)
def test_channel_driver_and_curve_are_those_that_were_put_in(channel, truth, driver, seed):
    _, outcome = _looked({channel: truth}, seed)
    (found,) = outcome.found
    assert found.way.name == channel
    assert found.depends_on == [driver]
    assert _agreement(found, truth) > 0.93
    inside = np.abs(found.values - np.mean(found.values) - truth(found.x, found.x) + np.mean(truth(found.x, found.x)))
    assert np.mean(inside < 3.0 * found.std + 0.1) > 0.9


def test_drag_by_the_square_is_told_as_such():
    _, outcome = _looked({"force_x": _drag}, 1)
    form = outcome.found[0].form
    assert form is not None and form.text.endswith("*speed*|speed|")
    assert form.weights[0] == pytest.approx(-0.08, rel=0.15)


def test_two_effects_are_found_one_on_top_of_the_other():
    _, outcome = _looked({"force_x": lambda h, u: _push(h, u) + 3 * _drag(h, u)}, 2)
    assert {(f.way.name, f.driver) for f in outcome.found} == {("force_x", "height"), ("force_x", "speed")}


def test_drivers_that_move_together_are_both_named():
    bench = Plain({"force_x": _push}, 3)
    for along in bench._along:
        noise = 0.02 * np.random.default_rng(9).standard_normal(NODES)
        along["speed"] = Driver("m/s", along["height"].values + noise, 0.3)
    found = find(Search(bench), ()).found[0]
    assert set(found.depends_on) == {"height", "speed"}


def test_elimination_is_that_of_a_dense_covariance():
    bench = Plain({"force_x": _push}, 4)
    search = Search(bench)
    bases = finding.over(bench, 2)
    taken = finding.Elimination(search, (), bench, bases)
    shape = bases["height"](bench.drivers(0)["height"].values)
    other = bases["height"](bench.drivers(1)["height"].values)
    moments = taken.moments([bench.columns(0, "force_x", shape), bench.columns(1, "force_x", other)])
    fit = search.fit(())
    columns, residual, free = [], [], []
    for i, part in enumerate((shape, other)):
        rows = bench.rows(i, fit.at)
        columns.append(np.vstack([part, np.zeros_like(part)]))
        residual.append(rows.residual + rows.signatures["slope"] * fit.at.get("slope", 0.0))
        own = np.zeros((2 * NODES, 4))
        own[:, 2 * i : 2 * i + 2] = rows.local * rows.local_std
        free.append(np.column_stack([own, 0.02 * rows.signatures["slope"]]))
    c, r, f = np.vstack(columns), np.concatenate(residual), np.vstack(free)
    weight = lambda m: m - f @ np.linalg.solve(np.eye(5) + f.T @ f, f.T @ m)  # noqa: E731 - by Woodbury
    assert moments.information == pytest.approx(c.T @ weight(c), rel=1e-6, abs=1e-6)
    assert moments.score == pytest.approx(c.T @ weight(r), rel=1e-6, abs=1e-5)


def test_evidence_of_noise_is_against_a_curve_and_grows_with_its_strength():
    rng = np.random.default_rng(5)
    noise = [weigh(Moments(1e3 * np.eye(6), np.sqrt(1e3) * rng.standard_normal(6))).nats for _ in range(300)]
    assert np.mean(np.exp(noise)) < 1.5  # of a Bayes factor where nothing is there: 1
    strong = [weigh(Moments(np.eye(6), np.array([d, 0, 0, 0, 0, 0]))).nats for d in (5.0, 10.0, 20.0)]
    assert strong == pytest.approx([0.5 * d**2 for d in (5.0, 10.0, 20.0)], abs=8.0)
    assert np.all(np.diff(strong) > 30.0)


def test_functions_are_orthonormal_over_what_was_visited_and_a_driver_that_stands_has_none():
    x = np.random.default_rng(6).gamma(2.0, 1.5, 4000)
    made = basis_module.basis(x, 0.3)
    at = made(x)
    assert at.T @ at / len(x) == pytest.approx(np.eye(6), abs=0.08)
    assert at.mean(axis=0) == pytest.approx(np.zeros(6), abs=0.02)
    assert basis_module.basis(np.full(1000, 3.0)) is None


def test_the_table_flies_within_what_was_visited_and_is_held_beyond():
    _, outcome = _looked({"force_x": _push}, 1)
    raptor = vehicles.load("raptor90")
    made = tables(outcome.found, raptor)
    name = "table_force_x_height"
    numbers = {key.rpartition(".")[2]: value for key, value in made.values.items()}
    pipeline = Pipeline([terms.KNOWN[name]], {name: numbers}, raptor.geometry)
    s = pipeline.signals()
    found, mass = outcome.found[0], float(raptor.geometry["mass"])
    for height in (-1.0, *found.x, 99.0):
        s["height"] = height
        pipeline.run(s, 0.002)
        held = np.interp(height, found.x, found.values) * mass
        assert s["force"] == pytest.approx([held, 0.0, 0.0], abs=0.06 * mass)
    assert len(made.values) == len(made.covariance) == 24


def test_a_multirotors_drag_on_its_lift_is_told_by_its_speed():
    craft, rng = load_multirotor("crazyflie"), np.random.default_rng(5000)
    columns = fly(craft, rng, 40.0)
    estimate, imu = columns["estimate"], columns["imu"]
    speed = np.hypot(np.asarray(estimate["ve"]), np.asarray(estimate["vn"]))
    imu["fz"] = np.asarray(imu["fz"]) + 6.0 * np.interp(imu["t"], estimate["t"], speed)
    flight = {topic: Table(topic, pa.table(dict(rows)), topic_of("measured", topic)) for topic, rows in columns.items()}
    found = examine({"flight": flight}, craft)
    (seen,) = found.verdict.unexplained
    assert (seen.channel, list(seen.depends_on)) == ("force_z", ["speed"])
    slope = np.polyfit(seen.curve.x, seen.curve.value, 1)[0]
    assert slope == pytest.approx(6.0, rel=0.4)
    findings = Findings(found.verdict, found, None)
    assert "force_z over speed" in sentence(findings.verdict)
    assert unexplained.draw(findings)[:4] == b"\x89PNG"
