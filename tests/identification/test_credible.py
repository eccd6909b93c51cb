"""What no verdict is taken from, and how far numbers are told to be off."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from identification import credible
from identification.causes import CATALOGUE
from identification.helicopter import HelicopterBench
from identification.search import Names, Search
from identification.widening import covariance
from sim.vehicle import load
from tests.identification.short_flight import Columns, made_table

HUB, K1, MASS = "terms.hub.stiffness", "cameras.down.k1", "mass"


@pytest.fixture(scope="module")
def search(flown: Columns) -> Search:
    tables = {topic: made_table(topic, found) for topic, found in flown.items()}
    return Search(HelicopterBench({"flight": tables}, load("raptor90")))


def moved(search: Search, names: Names, off: Mapping[str, float]) -> str | None:
    """What is said of a fit that has some numbers so many tolerances off."""
    bench, fit = search.bench, search.null
    at = {key: bench.nominal[key] + size * bench.tolerances[key] for key, size in off.items()}
    search.refits[names] = replace(fit, at=at, step=dict.fromkeys(fit.step, 0.0))
    try:
        return credible._strained(search, names)
    finally:
        search.refits[names] = fit


def test_a_number_far_beyond_its_tolerance_is_no_verdict(search: Search) -> None:
    said = moved(search, (), {HUB: -9.0})
    assert said is not None and said.startswith(f"{HUB} would have to be 9 of its tolerances")
    assert moved(search, (), {HUB: -7.0}) is None


def test_a_number_of_a_cause_that_was_found_may_be_as_far_off_as_it_likes(search: Search) -> None:
    assert moved(search, ("mass",), {MASS: 30.0}) is None
    assert moved(search, ("drag",), {MASS: 30.0}) is not None


def test_numbers_are_told_with_what_is_open_besides(search: Search) -> None:
    causes, linear = [CATALOGUE["mass"], CATALOGUE["lens_distortion"]], np.array([[0.04, 1e-4], [1e-4, 1e-6]])
    fit = replace(search.null, values={MASS: 5.5, K1: -0.2}, covariance=linear)
    beside = 0.06 * 0.2  # of a lens that is 0.2 off
    found = covariance(causes, fit, {MASS: 5.0, K1: 0.0}, 1.5)
    np.testing.assert_allclose(found, 2.25 * linear + np.diag([0.0, beside**2]))
