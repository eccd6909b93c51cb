"""How the replay is laid out: the scene at the left, the pictures beside it, curves and events below."""

from collections.abc import Sequence
from typing import Any

import rerun.blueprint as rrb

TIMELINE = "flight"
NIGHT = (18, 24, 33)  # the 3D scene's background; the ground fades into it

# one colour a quantity, in every plot
COLOURS: dict[str, tuple[int, int, int]] = {
    "truth": (245, 245, 245),
    "fusion": (64, 196, 255),
    "baro": (255, 167, 38),
    "gps": (124, 220, 110),
    "vision": (255, 92, 160),
    "sonar": (255, 235, 59),
}

TITLES = {"down": "Down camera", "forward_a": "Forward camera A", "forward_b": "Forward camera B"}


def blueprint(cameras: Sequence[str]) -> rrb.Blueprint:
    """The layout for a recording with pictures of these cameras."""
    pictures = [rrb.Spatial2DView(origin=f"cameras/{name}", name=TITLES.get(name, name)) for name in cameras]
    top: list[Any] = [_scene()]
    shares = [2.0]
    if pictures:
        first, *others = pictures
        column = [first, rrb.Horizontal(*others)] if others else [first]
        top.append(rrb.Vertical(*column, row_shares=[1.7, 1.0][: len(column)]))
        shares.append(1.05)
    heights = rrb.Tabs(
        _plot("height", "Height [m]"),
        _plot("height_error", "Height error [m]", (-1.0, 1.0)),
        _plot("climb", "Climb [m/s]"),
    )
    places = rrb.Tabs(_plot("position", "East and north [m]"), _plot("velocity", "Velocity east and north [m/s]"))
    hands = rrb.Tabs(_plot("controls", "Controls [deg]"), _plot("attitude", "Attitude [deg]"))
    engine = rrb.Tabs(_plot("rotor", "Rotor speed [rpm]"), _plot("throttle", "Throttle", (0.0, 1.0)))
    columns = rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["loglevel", "body"])
    events = rrb.TextLogView(origin="events", name="Events", columns=columns)
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(*top, column_shares=shares),
            rrb.Horizontal(heights, places, hands, engine, events, column_shares=[1.3, 1.0, 1.0, 0.8, 1.0]),
            row_shares=[1.75, 1.0],
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing"),
        auto_views=False,
    )


def _scene() -> Any:
    # trails show what has been flown up to the cursor
    so_far = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.0),
    )
    return rrb.Spatial3DView(
        origin="world",
        name="Flight",
        background=rrb.Background(color=NIGHT),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=(-7.5, -11.0, 6.5), look_target=(0.0, 0.0, 4.6), eye_up=(0.0, 0.0, 1.0)
        ),
        overrides={"world/path/true": so_far, "world/path/fused": so_far},
    )


def _plot(origin: str, name: str, span: tuple[float, float] | None = None) -> Any:
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        axis_y=rrb.ScalarAxis(range=span) if span is not None else None,
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )
