"""How the replay is laid out: the scene at the left, the pictures beside it, curves and events below."""

from collections.abc import Mapping
from typing import Any

import rerun.blueprint as rrb

from flightlog.camera import CameraModel

TIMELINE = "flight"
CHASE = "world/chase"  # moves with the vehicle, but does not turn: the frame of a camera that flies along
NIGHT = (18, 24, 33)  # the 3D scene's background; the ground fades into it

# one colour a quantity, in every plot; each can be told from a white and from a black background
COLOURS: dict[str, tuple[int, int, int]] = {
    "truth": (134, 138, 147),
    "fusion": (30, 136, 229),
    "baro": (245, 124, 0),
    "gps": (67, 160, 71),
    "vision": (226, 50, 124),
    "sonar": (197, 160, 0),
}
PALETTE = ((245, 124, 0), (30, 136, 229), (67, 160, 71), (226, 50, 124), (142, 95, 220), (0, 165, 165), (197, 160, 0))

TITLES = {"down": "Down camera", "forward_a": "Forward camera A", "forward_b": "Forward camera B"}


def blueprint(cameras: Mapping[str, CameraModel]) -> rrb.Blueprint:
    """The layout for a recording with pictures of these cameras, by name."""
    top: list[Any] = [
        _scene("Flight", "world", _eye((-9.5, -13.0, 6.2), (0.0, 0.0, 5.3))),
        _scene("Chase", CHASE, _eye((-1.7, -2.1, 1.0), (0.0, 0.0, -0.05))),
    ]
    shares = [0.9, 1.1]
    pictures = [_picture(name, model) for name, model in cameras.items()]
    if pictures:
        first, *others = pictures
        column = [first, rrb.Horizontal(*others)] if others else [first]
        top.append(rrb.Vertical(*column, row_shares=[1.7, 1.0][: len(column)]))
        shares.append(1.1)
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


def _scene(name: str, origin: str, eye: Any) -> Any:
    # trails show what has been flown up to the cursor
    so_far = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.0),
    )
    return rrb.Spatial3DView(
        origin=origin,
        contents="world/**",
        name=name,
        background=rrb.Background(color=NIGHT),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=eye,
        overrides={"world/path/true": so_far, "world/path/fused": so_far},
    )


def _eye(position: tuple[float, float, float], target: tuple[float, float, float]) -> rrb.EyeControls3D:
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=position,
        look_target=target,
        eye_up=(0.0, 0.0, 1.0),
    )


def _picture(name: str, model: CameraModel) -> Any:
    frame = rrb.VisualBounds2D(x_range=(0.0, float(model.width)), y_range=(0.0, float(model.height)))
    return rrb.Spatial2DView(origin=f"cameras/{name}", name=TITLES.get(name, name), visual_bounds=frame)


def _plot(origin: str, name: str, span: tuple[float, float] | None = None) -> Any:
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        axis_y=rrb.ScalarAxis(range=span) if span is not None else None,
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )
