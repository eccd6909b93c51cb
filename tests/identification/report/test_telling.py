"""The first picture shows what the cause changes; its band holds what gusts make of means."""

from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from scipy.signal import lfilter

from flightlog.tables import Table
from flightlog.topics import topic_of
from identification.diagnosis import examine, open_bench
from identification.gain import measure, of_each
from identification.report import Findings, sentence
from identification.report.drivers import drivers
from identification.report.means import MEMORY, Course, binned
from identification.report.panels import panels
from identification.report.panels.headline import draw
from identification.report.telling import choose, telling
from identification.report.unforeseen import at_rest, unforeseen
from identification.search import Search
from identification.told import told
from identification.verdict import BaselineReport, Verdict
from sim.multirotor import load_multirotor
from sim.multirotor.simulate import fly
from sim.rig import load_rig
from sim.rig_motion import Moving


def findings(diagnosis: Any) -> Findings:
    gain = measure(diagnosis)
    worth = of_each(diagnosis, gain)
    causes = [replace(cause, gain=worth.get(cause.name)) for cause in diagnosis.verdict.causes]
    return Findings(told(replace(diagnosis.verdict, causes=causes), diagnosis.search.causes), diagnosis, gain)


@pytest.mark.parametrize(
    ("key", "value", "channel", "driver"),
    [
        ("terms.ground_effect.gain", 2.0, "force_z", "height"),
        ("sensors.baro.drift_rate", 0.03, "baro.altitude", "time"),
    ],
)
@pytest.mark.parametrize(("flights", "landing"), [(3, False), (1, True)])
def test_picture_and_sentence_tell_of_what_changed(
    diagnosed: Any, key: str, value: float, channel: str, driver: str, flights: int, landing: bool
) -> None:
    found = findings(diagnosed({key: value}, flights=flights, landing=landing))
    (shown,) = telling(found)
    if driver == "height" or not landing:  # on one landing both only go one way
        assert (shown.course.channel, shown.course.driver) == (channel, driver)
    assert shown.course.channel == channel
    assert shown.course.departs
    assert np.all(np.abs(shown.course.after) < 1.3 * shown.course.band)
    assert shown.course.taken > 10.0
    assert channel in sentence(found.verdict)
    assert "0 % of what" not in sentence(found.verdict).replace("100 %", "")


def test_each_of_two_causes_has_a_picture_of_its_own(diagnosed: Any) -> None:
    found = findings(diagnosed({"terms.ground_effect.gain": 2.0, "sensors.baro.drift_rate": 0.03}))
    assert {(item.cause, item.course.channel) for item in telling(found)} == {
        ("ground_effect", "force_z"), ("baro_drift", "baro.altitude"),
    }  # fmt: skip
    png = draw(found)
    assert png is not None
    assert png.startswith(b"\x89PNG")


def test_where_nothing_is_wrong_all_means_lie_inside(diagnosed: Any) -> None:
    shown = telling(findings(diagnosed({})))
    assert shown
    assert all(item.cause is None for item in shown)
    outside = [np.mean(np.abs(item.course.before) > item.course.band) for item in shown]
    assert np.mean(outside) < 0.1


def course(driver: str, before: float, told_: float) -> Course:
    one = np.ones(4)
    return Course("force_z", "m/s^2", driver, driver, one, before * one, 0.0 * one, 0.1 * one, told_)


def test_the_driver_is_the_one_that_tells_and_not_what_merely_goes_along() -> None:
    height, roll, time, stick = (
        course("height", 1.0, 0.94), course("roll", 2.0, 0.3), course("time", 1.2, 0.98),
        course("collective", 2.0, 0.99),
    )  # fmt: skip
    found = choose([roll, stick, height, time])
    assert found is height
    assert choose([roll, time]) is time
    unseen, seen = course("climb", 0.25, 1.0), course("height", 0.5, 0.9)  # inside the band, and not
    assert choose([unseen, seen]) is seen
    assert choose([course("height", 0.0, 1.0)]) is None


@pytest.mark.parametrize("slow", [0.0, 0.5, 1.0])
def test_the_band_is_the_scatter_of_means_with_memory(slow: float) -> None:
    """Against many draws of noise, of whose variance a share remembers as gusts do."""
    rng, step, keep = np.random.default_rng(7), 0.1, np.exp(-0.1 / MEMORY)
    x = [np.concatenate([np.linspace(0.0, 10.0, 900), np.full(600, 10.0)]), rng.uniform(0.0, 10.0, 1500)]
    bins = binned(x, [np.ones(1500, bool)] * 2)
    assert bins is not None
    means, said = [], []
    for _ in range(300):
        begun = [lfilter([1.0], [1.0, -keep], rng.standard_normal(3000))[1500:] * np.sqrt(1.0 - keep**2) for _ in x]
        noise = [np.sqrt(slow) * s + np.sqrt(1.0 - slow) * rng.standard_normal(1500) for s in begun]
        means.append(bins.means(noise))
        said.append(bins.scatter(noise, step))
    assert np.sqrt(np.mean(np.square(said), axis=0)) == pytest.approx(np.std(means, axis=0), rel=0.2)


def test_at_rest_all_else_is_as_good_as_it_can_be(diagnosed: Any) -> None:
    """Against least squares with the number left out."""
    diagnosis = diagnosed({"terms.ground_effect.gain": 2.0})
    bench, key = diagnosis.bench, "terms.ground_effect.gain"
    fit = at_rest(bench, diagnosis.search.null, {key})
    assert key not in fit.at
    assert key not in fit.step
    keys = [name for name in bench.tolerances if name != key]
    rows = [bench.rows(i, {}) for i in range(3)]
    columns = np.concatenate([np.column_stack([r.signatures[name] for name in keys]) for r in rows])
    own = np.zeros((len(columns), 3))
    for i, r in enumerate(rows):
        own[1200 * i : 1200 * (i + 1), i] = r.local[:, 0] * r.local_std
    scale = np.array([bench.tolerances[name] for name in keys])
    whole = np.hstack([columns * scale, own])
    solved = np.linalg.solve(
        np.eye(whole.shape[1]) + whole.T @ whole, whole.T @ np.concatenate([r.residual for r in rows])
    )
    for name, wanted in zip(keys, (scale * solved[: len(keys)]).tolist(), strict=True):
        found = fit.at.get(name, bench.nominal[name]) + fit.step[name] - bench.nominal[name]
        assert found == pytest.approx(wanted, rel=1e-6, abs=1e-9)


def tables(columns: Any) -> dict[str, Table]:
    return {topic: Table(topic, pa.table(dict(part)), topic_of("measured", topic)) for topic, part in columns.items()}


def test_a_quadrotor_is_shown_the_lift_that_it_lacks() -> None:
    craft = load_multirotor("crazyflie")
    key, scale = "terms.thrust.scale", 0.8
    flown = tables(fly(craft, np.random.default_rng(3), 15.0, {key: scale * craft.values()[key]}))
    found = examine({"flight": flown}, craft, threshold=1e9)
    nominal = replace(found.search.null, at={}, step={})
    lacking = unforeseen(found.bench, 0, nominal)["force_z"]
    assert lacking.unit == "m/s^2"
    # the fit of what belongs to one flight alone may follow some of it
    assert -9.81 * (1.0 / scale - 1.0) * 1.3 < np.nanmean(lacking.values) < -0.2


def test_a_rig_is_shown_its_friction_over_the_rate() -> None:
    rig, key, rng, dt = load_rig("lab_helicopter"), "terms.joint_friction.yaw.viscous", np.random.default_rng(2), 0.02
    t = dt * np.arange(800)
    inputs = np.column_stack([np.full(800, 1.36), 1.0 + 0.5 * np.sign(np.sin(t))])
    more = 0.1
    moving = Moving(rig, dt, {key: rig.values()[key] + more}, 0.0025)
    angles = moving.run(np.array([[1.4, -0.45, 0.0, 0.0]]), moving.torques(inputs)[None])[0][:, :2]
    angles = angles + rng.normal(0.0, 1e-4, angles.shape)
    logged = tables({
        "joints": {"t": t, "yaw": angles[:, 0], "pitch": angles[:, 1]},
        "controls": {"t": t, "pitch_motor": inputs[:, 0], "yaw_motor": inputs[:, 1]},
    })  # fmt: skip
    bench = open_bench({"flight": logged}, rig)
    fit = replace(Search(bench).null, at={}, step={})
    lacking = unforeseen(bench, 0, fit)["joints.yaw"]
    rate = drivers(bench, 0)["yaw_rate"].at(lacking.t)
    assert np.corrcoef(lacking.values[5:-5], rate[5:-5])[0, 1] < -0.9


def test_without_a_vehicle_the_heights_are_shown() -> None:
    t = np.linspace(0.0, 60.0, 600)
    climb = 5.0 * np.sin(0.1 * t) ** 2
    logged = tables({
        "baro": {"t": t, "pressure": 101325.0 + 0.0 * t, "temperature": 288.0 + 0.0 * t, "altitude": climb},
        "gps": {"t": t, "u": climb + 0.1 * t},
    })  # fmt: skip
    verdict = Verdict(None, ["flight"], BaselineReport(True, None, {}, {}), [], [], [], [], [])
    drawn = panels(Findings(verdict, None, None, tables={"flight": logged}))
    assert [panel.name for panel in drawn] == ["heights"]
    assert panels(Findings(verdict, None, None)) == []
