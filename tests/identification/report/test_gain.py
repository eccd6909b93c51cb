"""Held-out prediction against the same computed the long way, and what the gain says of right and wrong causes."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from identification.folds import Hypothesis, Unit, confined, fifths, fitted, predict, turns, whole
from identification.gain import compare, measure, of_each
from identification.stack import Rows


def flights(rng: np.random.Generator, count: int, rows: int = 40) -> list[Rows]:
    return [
        Rows(
            rng.standard_normal(rows) * 2.0, {"a": rng.standard_normal(rows), "b": rng.standard_normal(rows)},
            rng.standard_normal((rows, 2)), np.array([0.5, 2.0]), np.zeros(rows, np.int64), np.arange(rows) * 0.1,
        )
        for _ in range(count)
    ]  # fmt: skip


def the_long_way(
    all_rows: list[Rows], units: list[Unit], held: int, std: dict[str, float], shift: dict[str, float]
) -> float:
    """log p(held | others) as a ratio of two plain Gaussians over everything."""

    def log_p(chosen: list[int]) -> float:
        residual, columns = [], []
        for i in chosen:
            rows, pick = all_rows[units[i].flight], units[i].rows
            r = rows.residual[pick] + sum(rows.signatures[k][pick] * shift.get(k, 0.0) for k in std)
            own = np.zeros((pick.sum(), 2 * len(all_rows)))
            own[:, 2 * units[i].flight : 2 * units[i].flight + 2] = rows.local[pick] * rows.local_std
            columns.append(np.hstack([np.column_stack([rows.signatures[k][pick] * s for k, s in std.items()]), own]))
            residual.append(r)
        x, r = np.vstack(columns), np.concatenate(residual)
        density = multivariate_normal.logpdf(r, np.zeros(len(r)), np.eye(len(r)) + x @ x.T)
        return float(density) + 0.5 * len(r) * np.log(2.0 * np.pi)

    return log_p(list(range(len(units)))) - log_p([i for i in range(len(units)) if i != held])


@pytest.mark.parametrize("single", [False, True])
def test_held_out_likelihood_is_the_ratio_of_two_gaussians(single: bool) -> None:
    rng = np.random.default_rng(3)
    rows = flights(rng, 1 if single else 3)
    units = fifths(rows[0]) if single else whole(rows)
    std, shift = {"a": 1.5, "b": 0.2}, {"a": 0.4, "b": -0.1}
    hypothesis = Hypothesis(rows, std, shift)
    for held in range(len(units)):
        found = predict(hypothesis, units, held, whole_fit=True).log_likelihood
        assert found == pytest.approx(the_long_way(rows, units, held, std, shift), abs=1e-9)


def test_a_cause_that_shows_in_one_fifth_alone_is_held_out_in_short_stretches() -> None:
    (rows,) = flights(np.random.default_rng(5), 1, rows=400)
    parts = fifths(rows)
    assert not confined(rows, ["a", "b"], parts)  # unlike the next, it shows all along
    late = dict(rows.signatures) | {"a": np.where(parts[-1].rows, rows.signatures["a"], 0.0)}
    ending = replace(rows, signatures=late)
    assert confined(ending, ["a"], parts)
    assert not confined(ending, ["b"], parts)
    assert sum(bool((unit.rows & parts[-1].rows).any()) for unit in turns(ending)) >= 4


def test_other_flights_are_predicted_from_all_that_were_fitted() -> None:
    rng = np.random.default_rng(4)
    rows = flights(rng, 3)
    std = {"a": 1.0, "b": 1.0}
    test = Hypothesis(rows[2:], std, {})
    apart = predict(Hypothesis(rows[:2], std, {}), whole(rows[:2]), 0, test, whole_fit=True)
    assert apart.log_likelihood == pytest.approx(the_long_way(rows, whole(rows), 2, std, {}), abs=1e-9)
    with pytest.raises(ValueError, match="same free numbers"):
        predict(Hypothesis(rows[:2], std, {}), whole(rows[:2]), 0, Hypothesis(rows[2:], {"a": 1.0}, {}))


def test_what_is_no_cause_is_not_trained() -> None:
    rows = flights(np.random.default_rng(8), 3)
    std = {"a": 1.5, "b": 0.2}
    alone = Hypothesis([rows[1]], std, {})
    untrained = predict(Hypothesis(rows, std, {}), whole(rows), 1).log_likelihood
    x, r = alone.design(whole([rows[1]])[0])
    density = multivariate_normal.logpdf(r, np.zeros(len(r)), np.eye(len(r)) + x @ x.T)
    assert untrained == pytest.approx(float(density) + 0.5 * len(r) * np.log(2.0 * np.pi), abs=1e-9)
    one = predict(Hypothesis(rows, std, {}, frozenset({"a"})), whole(rows), 1)
    assert set(one.nuisances) == {"b"}
    assert one.log_likelihood != untrained


def test_a_right_cause_gains_in_its_channel_on_what_was_not_fitted(diagnosed: Any) -> None:
    diagnosis = diagnosed({"terms.ground_effect.gain": 2.5})
    assert diagnosis.causes == ("ground_effect",)
    gain = measure(diagnosis)
    best = gain.best()
    assert best is not None
    assert gain.holds
    assert best.channel == "force_z"
    assert best.unit == "m/s^2"
    assert best.share_of_explainable > 0.9
    assert best.ratio_ci95[1] < 1.0
    assert best.after == pytest.approx(0.05, rel=0.1)  # noise alone is left
    assert gain.log_likelihood > 50.0
    assert of_each(diagnosis, gain)["ground_effect"].channel == "force_z"


def test_one_flight_is_judged_by_its_stretches_and_other_flights_by_themselves(diagnosed: Any) -> None:
    one = diagnosed({"terms.ground_effect.gain": 3.0}, flights=1)
    assert "fifths" in measure(one).how
    others = diagnosed({"terms.ground_effect.gain": 3.0}, flights=2, seed=9).bench
    apart = measure(one, others)
    assert "other flight" in apart.how
    assert [item.flight for item in apart.residuals] == others.names
    assert apart.holds


def test_what_shows_only_at_the_end_of_a_landing_is_gained_there(diagnosed: Any) -> None:
    """Each stretch held out must be told by others that have seen the ground too."""
    diagnosis = diagnosed({"terms.ground_effect.gain": 2.0}, flights=1, landing=True)
    gain = measure(diagnosis)
    best = gain.best()
    assert best is not None
    assert best.channel == "force_z"
    assert best.log_likelihood > 20.0
    assert best.share_of_explainable > 0.8
    assert best.ratio_ci95[1] < 1.0


def test_the_gain_of_channels_is_that_of_the_whole(diagnosed: Any) -> None:
    """Where what gives way has no tolerance, both are the same but for what nuisances spend."""
    gain = measure(diagnosed({"sensors.baro.drift_rate": 0.03}))
    assert sum(c.log_likelihood for c in gain.channels) == pytest.approx(gain.log_likelihood, rel=0.1)


def test_the_floor_gives_back_what_a_fit_follows_by_chance() -> None:
    """With a third of as many free numbers as rows the plain residual is a fifth too small; the floor is not."""
    rng, found, plain = np.random.default_rng(6), [], []
    for _ in range(40):
        x = rng.standard_normal((120, 40)) * 3.0
        rows = Rows(
            x @ rng.standard_normal(40) + rng.standard_normal(120), {str(i): x[:, i] for i in range(40)},
            np.zeros((120, 0)), np.zeros(0), np.zeros(120, np.int64), np.arange(120.0),
        )  # fmt: skip
        left = fitted(Hypothesis([rows], {str(i): 1.0 for i in range(40)}, {}), whole([rows])[0])
        found.append(np.mean(left**2))
        own = rows.residual - x @ np.linalg.lstsq(x, rows.residual, rcond=None)[0]
        plain.append(np.mean(own**2))
    assert np.mean(found) == pytest.approx(1.0, abs=0.06)
    assert np.mean(plain) < 0.75


def test_a_wrong_cause_does_not_gain(diagnosed: Any) -> None:
    """Planted: on flights where nothing is wrong a drift is asserted all the same."""
    diagnosis = diagnosed({})
    assert diagnosis.causes == ()
    planted = replace(diagnosis, causes=("baro_drift",))
    gain = compare(planted, (), planted.causes, None, 0)
    assert gain.log_likelihood < 3.0
    assert not gain.holds or gain.log_likelihood < 1.0
    assert all(abs(c.before - c.after) < 0.02 * c.before for c in gain.channels)


def test_nothing_asserted_gains_nothing(diagnosed: Any) -> None:
    gain = measure(diagnosed({}))
    assert gain.log_likelihood == 0.0
    assert all(c.before == c.after for c in gain.channels)
