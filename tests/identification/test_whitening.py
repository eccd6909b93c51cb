"""What is linear about the filters: signatures against the filters run again, tick means, and the shake taken out."""

import math
from dataclasses import dataclass, replace
from typing import Any
from unittest import mock

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import block_diag

from identification import kinematics
from identification.causes import CATALOGUE
from identification.drive import Noise, judge
from identification.dynamics import innovations
from identification.evidence import Sheet
from identification.flight import prepare
from identification.grid import smooth
from identification.gusts import followed
from identification.model import Model
from identification.stack import Rows, stack
from identification.vibration import calm
from identification.whitening import drive_signatures, sensor_signatures
from sim.vehicle import load
from sim.wind.mean import mean_speed
from tests.identification.short_flight import Columns, copied, made_table

Floats = NDArray[np.float64]

NODES = 80
STEP = 0.04


KEEP = np.tile([0.99, 0.985, 0.95], (NODES, 1))
GUSTS = np.tile([0.3, 0.4, 0.5], (NODES, 1))
SOONER = np.tile([0.1, -0.2, 0.9], (NODES, 1))
INFLOW = followed(0.3)


def _filter(answer: Floats, measured: Floats, gust: Floats, noise: Noise) -> tuple[Floats, Floats, Floats]:
    gains, spreads, out = np.zeros((NODES, 7, 10)), np.zeros((NODES, 7)), np.zeros((NODES, 7))
    innovations(
        answer, measured, gust, SOONER, *INFLOW, STEP, KEEP, GUSTS, np.array(noise.process),
        np.array(noise.noise), gains, spreads, out,
    )  # fmt: skip
    return gains, spreads, out / spreads


def _signatures(gust: Floats, gains: Floats, spreads: Floats, model: Floats, measured: Floats) -> Floats:
    changes = model[:, :, None], measured[:, :, None]
    return np.asarray(drive_signatures(gust, SOONER, INFLOW[0], gains, spreads, STEP, KEEP, *changes))


def test_the_signature_of_a_changed_model_is_what_the_filter_makes_of_it() -> None:
    rng = np.random.default_rng(3)
    noise = Noise()
    answer, measured = rng.normal(size=(2, NODES, 7))
    gust = 0.3 * rng.normal(size=(NODES, 7, 3))
    gains, spreads, before = _filter(answer, measured, gust, noise)
    change = rng.normal(size=(NODES, 7))
    _, _, after = _filter(answer + change, measured, gust, noise)
    found = _signatures(gust, gains, spreads, change, np.zeros((NODES, 7)))
    assert np.allclose(found[:, :, 0], after - before, atol=1e-9)


def test_after_nodes_on_the_ground_the_count_begins_anew_for_filter_and_signature() -> None:
    rng = np.random.default_rng(5)
    noise = Noise()
    answer, measured = rng.normal(size=(2, NODES, 7))
    measured[30:36] = np.nan
    gust = 0.3 * rng.normal(size=(NODES, 7, 3))
    gains, spreads, before = _filter(answer, measured, gust, noise)
    change, lasting = rng.normal(size=(NODES, 7)), np.zeros((NODES, 7))
    _, _, after = _filter(answer + change, measured, gust, noise)
    found = _signatures(gust, gains, spreads, change, np.zeros((NODES, 7)))
    assert np.allclose(found[:, :, 0], after - before, atol=1e-9)
    lasting[36:, 3:] = 5.0  # what rates and rotor speed have become on the ground is no innovation
    _, _, later = _filter(answer, measured + lasting, gust, noise)
    assert np.allclose(later, before, atol=1e-9)


def test_the_signature_of_a_changed_measurement_is_what_the_filter_makes_of_it() -> None:
    rng = np.random.default_rng(4)
    noise = Noise()
    answer, measured = rng.normal(size=(2, NODES, 7))
    gust = 0.3 * rng.normal(size=(NODES, 7, 3))
    gains, spreads, before = _filter(answer, measured, gust, noise)
    change = rng.normal(size=(NODES, 7))
    change[0, 3:] = 0.0  # a first reading is where the count begins
    _, _, after = _filter(answer, measured + change, gust, noise)
    found = _signatures(gust, gains, spreads, np.zeros((NODES, 7)), change)
    assert np.allclose(found[:, :, 0], after - before, atol=1e-9)


def test_the_shake_is_taken_out_and_the_motion_left() -> None:
    t = 0.004 * np.arange(5000)
    rotor = 157.0 - 6.0 * np.sin(0.3 * t)
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (rotor[1:] + rotor[:-1]) * np.diff(t))])
    motion = np.sin(2.0 * np.pi * 0.7 * t)[:, None] * np.ones(6)
    shake = np.column_stack(
        [a * np.cos(phase) + b * np.cos(2.0 * phase + 1.0) + c * np.sin(4.6 * phase) for a, b, c in np.ones((6, 3))]
    )
    left = calm(t, motion + shake, rotor, 4.66) - motion
    assert np.abs(left[500:-500]).max() < 0.02


def test_smoothing_keeps_what_is_slow_and_removes_a_turn() -> None:
    t = 0.004 * np.arange(1000)
    slow, turn = np.sin(2.0 * np.pi * 2.0 * t), np.cos(2.0 * np.pi * 25.0 * t)
    kept = smooth(slow + turn, 10)[50:-50]
    assert np.abs(kept - slow[50:-50]).max() < 1e-3


# --- what sensors measure, against the whole filter of the motion run again -------------------------------------------


def near(found: Floats, right: Floats, share: float) -> bool:
    return bool(np.linalg.norm(found - right) < share * np.linalg.norm(right))


TOUCH = 1e-3  # standard deviations by which a measurement is changed


@dataclass(frozen=True, eq=False)
class Way:
    """The filter of the motion along a flown flight whose sensors all say what it expects: linear in small changes."""

    arguments: tuple[Any, ...]  # of `kinematics.track`, outputs included

    def answer(self, values: Floats | None = None, imu: Floats | None = None, stds: Floats | None = None) -> Floats:
        """Innovations (M, 3) of changed measurements; what was recorded stays."""
        a = [item.copy() if isinstance(item, np.ndarray) else item for item in self.arguments]
        for place, given in ((1, imu), (6, values), (7, stds)):
            a[place] = a[place] if given is None else given
        kinematics.track(*a)
        return np.asarray(a[-1])

    def whitened(self, **changed: Floats) -> Floats:
        nu, s, weight = self.answer(**changed).T
        return np.asarray(np.sqrt(weight) * nu / s)

    def signature(self, dz: Floats, df: Floats, dw: Floats, state: int | None = None) -> Floats:
        begin = np.zeros((kinematics.STATES, 1))
        if state is not None:
            begin[state] = -1.0
        first, decay, way, rows, gains, answers = (self.arguments[i] for i in (3, 15, 16, 18, 19, 20))
        change = dz[:, None], df[:, :, None], dw[:, :, None], begin
        return np.asarray(sensor_signatures(way, rows, gains, answers, first, STEP, decay, *change))[:, 0]


@pytest.fixture(scope="module")
def way(flown: Columns) -> Way:
    seen: list[tuple[Any, ...]] = []
    track = kinematics.track

    def spy(*arguments: Any) -> Any:
        seen.append(arguments)
        return track(*arguments)

    tables = {topic: made_table(topic, columns) for topic, columns in flown.items()}
    with mock.patch.object(kinematics, "track", spy):
        prepare("flight", tables, load("raptor90"))
    drifting = Way(tuple(np.array(item) if isinstance(item, np.ndarray) else item for item in seen[-1]))
    values, stds = drifting.arguments[6], drifting.arguments[7]
    # a filter that corrects nothing expects what it would be told: then every innovation is nought
    expected = values - drifting.answer(stds=np.full_like(stds, 1e9))[:, 0]
    found = Way((*drifting.arguments[:6], expected, *drifting.arguments[7:]))
    kinematics.track(*found.arguments)
    assert np.abs(found.arguments[20][:, 0]).max() < 1e-6
    return found


@pytest.mark.parametrize("channel", ["gps.e", "gps.vu", "baro.altitude", "sonar.range", "mag.my", "pad.x", "pad.angle"])
def test_a_changed_sensor_is_what_the_whole_filter_makes_of_it(way: Way, channel: str) -> None:
    kinds, times, values, stds = way.arguments[4:8]
    own = kinds == kinematics.CHANNELS.index(channel)
    assert own.sum() > 50
    dz = np.where(own, stds * np.sin(1.3 * times + 0.4), 0.0)
    nodes = len(way.arguments[3]) - 1
    found = way.signature(dz, np.zeros((nodes, 3)), np.zeros((nodes, 3)))
    right = (way.whitened(values=values + TOUCH * dz) - way.whitened(values=values - TOUCH * dz)) / (2.0 * TOUCH)
    assert near(found, right, 0.01)
    share = found - dz / way.arguments[20][:, 1]
    assert np.linalg.norm(share) > 0.05 * np.linalg.norm(found)  # what the state takes up
    assert near(share, right - dz / way.arguments[20][:, 1], 0.02)


@pytest.mark.parametrize("axis", range(6))
def test_a_changed_inertial_sensor_is_what_the_whole_filter_makes_of_it(way: Way, axis: int) -> None:
    imu_t, imu, edges = way.arguments[:3]
    nodes = len(edges) - 1
    slow = np.sin(0.9 * imu_t + 0.2)
    per_node = np.add.reduceat(slow[: edges[-1]], edges[:-1]) / np.diff(edges)
    df, dw = np.zeros((nodes, 3)), np.zeros((nodes, 3))
    (df if axis < 3 else dw)[:, axis % 3] = per_node
    found = way.signature(np.zeros(len(way.arguments[4])), df, dw)
    size, change = 1e-4, np.zeros_like(imu)
    change[:, axis] = slow
    right = (way.whitened(imu=imu + size * change) - way.whitened(imu=imu - size * change)) / (2.0 * size)
    assert near(found, right, 0.02)


FOLLOWED = (kinematics.CASE, kinematics.CASE + 1, kinematics.RATE_SCALE, kinematics.RATE_SCALE + 2)


@pytest.mark.parametrize("state", FOLLOWED)
def test_an_error_that_the_filter_follows_is_what_the_whole_filter_makes_of_it(way: Way, state: int) -> None:
    imu = way.arguments[1]
    size, unit = 1e-4, np.eye(3)
    change = np.zeros_like(imu)
    if state >= kinematics.RATE_SCALE:
        change[:, 3 + state - kinematics.RATE_SCALE] = imu[:, 3 + state - kinematics.RATE_SCALE]
    else:  # a case turned by a sees v - a x v
        axis = unit[state - kinematics.CASE]
        change[:, :3], change[:, 3:] = -np.cross(axis, imu[:, :3]), -np.cross(axis, imu[:, 3:])
    nodes = len(way.arguments[3]) - 1
    nothing = np.zeros((nodes, 3))
    found = way.signature(np.zeros(len(way.arguments[4])), nothing, nothing, state)
    right = (way.whitened(imu=imu + size * change) - way.whitened(imu=imu - size * change)) / (2.0 * size)
    assert near(found, right, 0.05)


# --- what the model answers, against the whole sheet under a changed model --------------------------------------------

KNOBS = {"mass": 0.05, "terms.main_rotor.thrust_scale": 0.01, "terms.ground_effect.gain": 0.2, "terms.drag.linear": 0.1,
         "terms.servo.tau": 0.005, "inertia.2": 0.01}  # fmt: skip


@pytest.fixture(scope="module")
def sheet(flown: Columns) -> Sheet:
    vehicle = load("raptor90")
    flight = prepare("flight", {topic: made_table(topic, columns) for topic, columns in flown.items()}, vehicle)
    model = Model(vehicle)
    found = Sheet(model, flight, [CATALOGUE["imu_bias"], CATALOGUE["baro_drift"]], list(KNOBS))
    found.linearise()
    found.whiten(Noise())
    return found


@pytest.mark.parametrize("key", KNOBS)
def test_the_signature_of_a_number_is_what_the_innovations_lose_by_it(sheet: Sheet, key: str) -> None:
    """Rows are r = J theta + e: a model that has theta already leaves r - J theta."""
    knob, step = sheet.model.knobs[key], KNOBS[key]
    moved = sheet.residual({key: knob.nominal + step}) - sheet.residual({})
    assert np.linalg.norm(moved) > 0.0
    assert near(-step * sheet.columns[key], moved, 0.1)


@pytest.mark.parametrize("axis", range(2))
def test_the_signature_of_wind_is_what_the_innovations_lose_by_it(sheet: Sheet, axis: int) -> None:
    # to either side, as the slope is taken: what goes with the square of the wind falls out
    less, more = (sheet.residual(sheet.at, sheet.wind + side * 0.3 * np.eye(3)[axis]) for side in (-1.0, 1.0))
    assert near(-0.6 * sheet.columns[("wind.e", "wind.n")[axis]], more - less, 0.1)


@pytest.mark.parametrize("axis", range(3))
def test_the_signature_of_a_force_that_a_sensor_adds_is_what_the_innovations_gain_by_it(
    sheet: Sheet, axis: int
) -> None:
    size, flight = 0.05, sheet.flight
    measured = flight.measured.copy()
    measured[:, axis] += size
    calm = judge(flight, sheet.wind, sheet._driven.answer, sheet.gust, sheet.noise).residual
    moved = judge(replace(flight, measured=measured), sheet.wind, sheet._driven.answer, sheet.gust, sheet.noise)
    change = np.concatenate([np.zeros(len(flight.motion.kinds)), (moved.residual - calm).ravel()])
    change[~sheet._late] = 0.0
    assert near(size * sheet.columns[f"local.force_{axis}"], change, 1e-6)


def test_what_passing_air_does_to_the_barometer_is_what_innovations_gain_by_it(flown: Columns, sheet: Sheet) -> None:
    motion, key, wind = sheet.flight.motion, "local.sensors.baro.port_coefficient", np.array([7.0, -3.0, 0.0])
    share = np.array([mean_speed(height, 1.0) for height in motion.position[:, 2]])[:, None]
    # a coefficient of 1: half rho v^2 more, which is v^2/2g of height less, behind the lag
    air = np.sum((motion.velocity[:, :2] - share * wind[:2]) ** 2, axis=1)
    high = np.interp(motion.t - sheet.flight.baro_lag, motion.t, -air / (2.0 * 9.80665))
    columns = copied(flown)
    columns["baro"]["altitude"] = columns["baro"]["altitude"] + 0.3 * np.interp(columns["baro"]["t"], motion.t, high)
    blown = prepare("flight", {topic: made_table(topic, found) for topic, found in columns.items()}, load("raptor90"))
    there = Sheet(sheet.model, sheet.flight, [], list(KNOBS))
    there.wind = wind
    there.linearise()
    at = motion.kinds == kinematics.BARO
    assert np.ptp(0.3 * high) > 0.2
    assert near(0.3 * there._above[key][at], (blown.motion.whitened - motion.whitened)[at], 0.3)


@pytest.mark.parametrize("seen", [0.005, 0.02])
def test_a_scale_is_not_told_by_how_well_it_shrinks_noise(sheet: Sheet, seen: float) -> None:
    """A rate that is pushed at random shrinks with its scale; that is no evidence of one.

    Nor where the filter takes the gyro for noisier than it is (`seen` [rad/s]) and is surprised for some nodes.
    """
    flight, level = sheet.flight, replace(Noise(), noise=(0.1, 0.1, 0.15, 0.005, 0.005, seen, 0.3))
    noise = np.cumsum(np.random.default_rng(6).normal(0.0, Noise().process[5], len(flight.motion.t)))
    measured, way = flight.measured.copy(), flight.motion.way.copy()
    measured[:, 5] += noise
    way[:, 14] += noise
    shaken = replace(flight, measured=measured, motion=replace(flight.motion, way=way))
    found = Sheet(sheet.model, shaken, [CATALOGUE["imu_scale"]], list(KNOBS))
    found.linearise()
    found.whiten(level)
    at = found.channel == 105
    column, left = found.columns["sensors.imu.scale_wz"][at], found.residual({})[at]
    told = abs(column @ left) / (column @ column)
    assert told < 0.2
    as_measured = found._columns({}, found._measured)["sensors.imu.scale_wz"][at]
    assert abs(as_measured @ left) / (as_measured @ as_measured) > 0.5


def test_a_single_puff_from_below_is_what_slopes_and_inflow_say(sheet: Sheet) -> None:
    """Two thirds of a second of one node's puff, by the model itself, where nobody looked when slopes were taken."""
    size, at, nodes = 0.3, 101, len(sheet.flight.motion.t)
    puff = np.zeros((nodes, 3))
    puff[at, 2] = size
    drive, gust = sheet.flight.drive, sheet.gust
    right = sheet.model.answer(drive, sheet.wind, {}, puff) - sheet.model.answer(drive, sheet.wind, {}, -puff)
    left = float(gust.follow[1, 1])
    follows = np.array([0.0, *(1.0 - left) * left ** np.arange(10)])  # of one node's gust, in the nodes after it
    mean = (1.0 - left) / -math.log(left)
    found = 2.0 * size * gust.sooner[at, 2] * mean * np.array([1.0, *(-follows[1:])])
    found[0] += 2.0 * size * gust.slopes[at, 2, 2]
    assert found[0] > 1.3 * 2.0 * size * gust.slopes[at, 2, 2]  # a gust that stays does much less
    assert near(found, right[at : at + 11, 2], 0.05)


# --- gusts and locals taken out, against dense algebra ----------------------------------------------------------------


def test_taking_out_gusts_is_the_likelihood_with_all_gusts_integrated_over() -> None:
    """The filter's sum of squares and determinants against the covariance of everything measured, written out."""
    rng, nodes, noise = np.random.default_rng(8), 12, Noise()
    keep, sigma = np.full((nodes, 3), 0.987), GUSTS[:nodes]
    model, measured = rng.normal(size=(2, nodes, 7))
    gust = rng.normal(size=(nodes, 7, 3))
    gains, spreads, out = np.zeros((nodes, 7, 10)), np.zeros((nodes, 7)), np.zeros((nodes, 7))
    found = innovations(model, measured, gust, SOONER[:nodes], *INFLOW, STEP, keep, sigma, np.array(noise.process),
                        np.array(noise.noise), gains, spreads, out)  # fmt: skip
    # unknowns in order: gusts from aside (nodes, 2); the upward one before the first node and what is new at each,
    # (nodes, 4): gust, followed by the inflow, means of both; steps of rates and rotor speed (nodes - 1, 4); error of
    # their first reading
    far = np.abs(np.arange(nodes)[:, None] - np.arange(nodes))
    follow, fresh = INFLOW
    new = (1.0 - keep[0, 2] ** 2) * sigma[0, 2] ** 2 * fresh
    blocks = [np.kron(keep[0, 0] ** far, np.diag(sigma[0, :2] ** 2)), [[sigma[0, 2] ** 2]],
              np.kron(np.eye(nodes), new), np.kron(np.eye(nodes - 1), np.diag(np.square(noise.process[3:]))),
              np.diag(np.square(noise.noise[3:]))]  # fmt: skip
    prior = block_diag(*blocks)
    onward = np.column_stack([follow, np.zeros((4, 2))])
    onward[0, 0] = keep[0, 2]
    up = np.zeros((nodes, 4, len(prior)))  # gust, followed, means of both, by the unknowns
    first, steps = 2 * nodes, 6 * nodes + 1
    before = np.zeros((4, len(prior)))
    before[:, first] = 1.0
    for n in range(nodes):
        up[n] = onward @ before
        up[n][:, first + 1 + 4 * n : first + 5 + 4 * n] = np.eye(4)
        before = up[n]
    rows: list[Floats] = []
    left: list[float] = []
    levels: list[float] = []
    for n in range(nodes):
        for k in range(3):
            row = (gust[n, k, 2] + SOONER[n, k]) * up[n, 2] - SOONER[n, k] * up[n, 3]
            row[2 * n : 2 * n + 2] = gust[n, k, :2]
            rows, left, levels = [*rows, row], [*left, measured[n, k] - model[n, k]], [*levels, noise.noise[k]]
        for k in range(3, 7):
            if n == 0:
                continue
            row = np.zeros(len(prior))
            for m in range(1, n + 1):
                for at in (m - 1, m):  # a mean rate changes by what blew on either node
                    row[2 * at : 2 * at + 2] += 0.5 * STEP * gust[m, k, :2]
                    row += 0.5 * STEP * gust[m, k, 2] * up[at, 0]
                row[steps + 4 * (m - 1) + k - 3] = 1.0
            row[steps + 4 * (nodes - 1) + k - 3] = 1.0
            grown = measured[0, k] + STEP * model[1 : n + 1, k].sum()
            rows, left, levels = [*rows, row], [*left, measured[n, k] - grown], [*levels, noise.noise[k]]
    h, r = np.array(rows), np.array(left)
    covariance = h @ prior @ h.T + np.diag(np.square(levels))
    assert found == pytest.approx(r @ np.linalg.solve(covariance, r) + np.linalg.slogdet(covariance)[1], rel=1e-9)


def test_locals_are_eliminated_as_a_dense_solve_has_it() -> None:
    rng, flights = np.random.default_rng(9), []
    for count in (30, 40):
        flights.append(Rows(
            rng.normal(size=count), {key: rng.normal(size=count) for key in "ab"}, rng.normal(size=(count, 3)),
            rng.uniform(0.1, 2.0, 3), np.zeros(count, int), np.arange(count, dtype=float), rng.normal(size=3),
        ))  # fmt: skip
    found = stack(flights, ("a", "b"))
    information, score, square, logs = np.zeros((2, 2)), np.zeros(2), 0.0, 0.0
    for f in flights:
        covariance = np.eye(len(f.residual)) + f.local @ np.diag(f.local_std**2) @ f.local.T
        j, r = np.column_stack([f.signatures["a"], f.signatures["b"]]), f.residual + f.local @ f.at
        information += j.T @ np.linalg.solve(covariance, j)
        score += j.T @ np.linalg.solve(covariance, r)
        square += float(r @ np.linalg.solve(covariance, r))
        logs -= 0.5 * float(np.linalg.slogdet(covariance)[1])
    assert np.allclose(found.information, information)
    assert np.allclose(found.score, score)
    assert found.square == pytest.approx(square)
    assert found.log_local == pytest.approx(logs)


def test_a_gust_that_walks_at_random_has_ends_and_means_as_closed_form_says() -> None:
    """Means of a Wiener process over a node: variance 1/3 and covariance 1/2 with its step; a lag follows it."""
    left = 0.3
    follow, fresh = followed(left)
    np.testing.assert_allclose(follow[:, 0], [1.0, 1.0 - left, 1.0, 1.0 - (1.0 - left) / -math.log(left)], rtol=1e-9)
    np.testing.assert_allclose(follow.sum(axis=1), 1.0, rtol=1e-9)  # what stays as it is, stays
    assert fresh[0, 0] == pytest.approx(1.0)
    assert fresh[0, 2] == pytest.approx(0.5)
    assert fresh[2, 2] == pytest.approx(1.0 / 3.0)
    assert fresh[1, 3] == pytest.approx(0.5 * _walked(left), rel=2e-2)
    np.testing.assert_allclose(fresh, fresh.T, atol=1e-12)


def _walked(left: float) -> float:
    """(E m_l l)/0.5 by many small steps, l following a Wiener process of unit variance over the node."""
    steps, rate = 400, -math.log(left)
    h = 1.0 / steps
    # l as a sum over the steps' increments, its mean the same
    weight = np.array([1.0 - math.exp(-rate * (1.0 - (i + 0.5) * h)) for i in range(steps)])
    mean = np.array([(1.0 - (i + 0.5) * h) - (1.0 - math.exp(-rate * (1.0 - (i + 0.5) * h))) / rate
                     for i in range(steps)])  # fmt: skip
    return float(2.0 * h * np.sum(weight * mean))
