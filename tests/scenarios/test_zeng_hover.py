"""Two minutes on flow, made short."""

from pathlib import Path

import numpy as np
import pytest

from flightlog.readers.folder import read_flight
from scenarios.experiments import zeng_hover
from scenarios.flight import fly
from scenarios.load import load


@pytest.fixture(scope="module")
def ours() -> zeng_hover.Course:
    return zeng_hover.hover("helideck", 7, 15.0, False)


@pytest.fixture(scope="module")
def theirs() -> zeng_hover.Course:
    return zeng_hover.hover("published", 7, 15.0, False)


def test_ours_holds_within_five_centimetres_on_flow_alone(ours: zeng_hover.Course) -> None:
    settled = ours.t > zeng_hover.SETTLED
    assert ours.away[settled].max() < 0.05
    assert ours.lost[settled].max() < 0.012
    assert np.sqrt(np.mean(ours.velocity_error[settled, :2] ** 2)) < 0.005
    assert np.abs(ours.position[settled, 2]).max() < 0.05


def test_the_inertial_sensors_alone_run_away(theirs: zeng_hover.Course) -> None:
    assert np.hypot(*theirs.inertial_velocity[-1]) > 0.1
    assert np.hypot(*theirs.inertial_velocity[-1]) > 10.0 * np.hypot(*theirs.velocity_error[-1, :2])
    assert theirs.away.max() < 0.5


def test_the_experiment_concludes_from_flights(ours: zeng_hover.Course, theirs: zeng_hover.Course) -> None:
    outcome = zeng_hover.conclude("quick", [ours, theirs, [ours] * 4])
    figures = {figure.quantity: figure for figure in outcome.figures}
    first = figures["farthest from the target"]
    assert first.published == 0.5
    assert first.reached
    assert first.reproduced
    assert len(zeng_hover.jobs("quick")) == 3
    assert all(np.all(np.isfinite(series.y)) for plot in outcome.plots for series in plot.series)


def test_a_flight_on_flow_is_recorded_and_never_hears_the_gps(tmp_path: Path) -> None:
    fly(load("gps_denied_hover", {"duration_s": 3.0}), seed=1, cameras=False, folder=tmp_path / "flight")
    log = read_flight(tmp_path / "flight")
    assert "gps" not in log.measured
    assert "pad" not in log.measured
    flow = log.measured["flow"]
    assert len(flow) > 60
    assert {"t", "t_arrival", "dt", "u", "v", "quality"} <= set(flow.arrow.column_names)


@pytest.mark.slow
def test_by_rendered_pictures_it_hovers_as_by_their_error_model() -> None:
    seen, said = (zeng_hover.hover("helideck", 1, 12.0, rendered) for rendered in (True, False))
    settled = seen.t > zeng_hover.SETTLED
    assert seen.away[settled].max() == pytest.approx(said.away[settled].max(), abs=0.004)
    assert seen.lost[settled].max() == pytest.approx(said.lost[settled].max(), abs=0.002)
