"""Writes a recording of one flight several times over: as it was measured, and as models say it should have been.

Importing this module imports rerun: do it late.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from flightlog.errors import UserError
from flightlog.marks import Mark
from flightlog.replay_layout import NIGHT, TIMELINE
from flightlog.replay_scene import Mesh, log_scene, log_vehicle
from flightlog.replay_series import thin

Floats = NDArray[np.float64]

RATE, TRAIL_RATE = 25.0, 10.0  # [Hz]
COLOURS = ((150, 150, 150), (226, 85, 60), (60, 140, 230), (67, 160, 71))  # by track; seen on light and dark
COLOUR_NAMES = ("in its own colours", "red", "blue", "green")
CHASE = "world/chase"


@dataclass(frozen=True, eq=False)
class Track:
    """One vehicle's way. Breaks: it starts anew there, and no path leads over them."""

    name: str
    t: Floats  # (N,) [s]
    position: Floats  # (N, 3) [m] ENU
    attitude: Floats  # (N, 4) wxyz, body to world
    breaks: NDArray[np.intp]  # rows


def write_pair(file: Path, tracks: Sequence[Track], meshes: Mapping[str, Mesh], mark: Mark | None, title: str) -> None:
    """Write the recording: the first track's vehicle in its own colours, the others' tinted; UserError for the file."""
    rec = rr.RecordingStream("helideck", send_properties=False)
    try:
        rec.save(file, default_blueprint=_layout([track.name for track in tracks]))
    except RuntimeError as error:
        raise UserError(f"{file}: cannot be written: {str(error).splitlines()[0]}") from None
    rec.send_recording_name(title)
    log_scene(rec, meshes, mark)
    for i, (track, colour) in enumerate(zip(tracks, COLOURS, strict=False)):
        place = "world/vehicle" if i == 0 else f"world/{_entity(track.name)}"
        if i:
            red, green, blue = (c / 255 for c in colour)
            log_vehicle(rec, meshes, place, (red, green, blue))
        chosen = thin(track.t, RATE)
        when = [rr.TimeColumn(TIMELINE, duration=track.t[chosen])]
        turns = track.attitude[chosen][:, [1, 2, 3, 0]]
        rec.send_columns(
            place, indexes=when, columns=rr.Transform3D.columns(translation=track.position[chosen], quaternion=turns)
        )
        if i == 0:
            rec.send_columns(CHASE, indexes=when, columns=rr.Transform3D.columns(translation=track.position[chosen]))
        _trail(rec, f"world/path/{_entity(track.name)}", track, colour)
        for axis, name in enumerate(("east", "north", "height")):
            values = track.position[chosen, axis]
            _curve(rec, f"{name}/{_entity(track.name)}", track.t[chosen], values, colour, track.name)
        if i:
            there = np.column_stack([np.interp(track.t, tracks[0].t, tracks[0].position[:, k]) for k in range(3)])
            apart = np.linalg.norm(track.position - there, axis=1)
            _curve(rec, f"apart/{_entity(track.name)}", track.t[chosen], apart[chosen], colour, track.name)
    rec.flush()
    rec.disconnect()


def _entity(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name)


def _trail(rec: rr.RecordingStream, place: str, track: Track, colour: Sequence[int]) -> None:
    rows = thin(track.t, TRAIL_RATE)
    if len(rows) < 2:
        return
    pieces = np.stack([track.position[rows[:-1]], track.position[rows[1:]]], axis=1).astype(np.float32)
    part = np.searchsorted(track.breaks, rows, side="right")
    whole = part[:-1] == part[1:]
    rec.log(place, rr.LineStrips3D.from_fields(colors=[colour], radii=[0.006]), static=True)
    rec.send_columns(
        place,
        indexes=[rr.TimeColumn(TIMELINE, duration=track.t[rows[1:]][whole])],
        columns=rr.LineStrips3D.columns(strips=list(pieces[whole])),
    )


def _curve(rec: rr.RecordingStream, place: str, t: Floats, values: Floats, colour: Sequence[int], name: str) -> None:
    rec.log(place, rr.SeriesLines(colors=[colour], names=name, widths=[1.5]), static=True)
    rec.send_columns(place, indexes=[rr.TimeColumn(TIMELINE, duration=t)], columns=rr.Scalars.columns(scalars=values))


def _layout(names: Sequence[str]) -> rrb.Blueprint:
    so_far = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.0),
    )

    def scene(name: str, origin: str, position: tuple[float, ...], target: tuple[float, ...]) -> Any:
        eye = rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=position, look_target=target, eye_up=(0.0, 0.0, 1.0)
        )
        return rrb.Spatial3DView(
            origin=origin, contents="world/**", name=name, background=rrb.Background(color=NIGHT),
            line_grid=rrb.LineGrid3D(visible=False), eye_controls=eye,
            overrides={"world/path/**": so_far},
        )  # fmt: skip

    told = "; ".join(f"{name}: {colour}" for name, colour in zip(names, COLOUR_NAMES, strict=False))
    plots = [("height", "Height [m]"), ("east", "East [m]"), ("north", "North [m]"), ("apart", "Apart [m]")]
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                scene("Flight", "world", (-9.5, -13.0, 6.2), (0.0, 0.0, 5.3)),
                scene(told, CHASE, (-2.6, -3.2, 1.4), (0.0, 0.0, 0.0)),
            ),
            rrb.Horizontal(*(rrb.TimeSeriesView(origin=origin, name=name) for origin, name in plots)),
            row_shares=[1.75, 1.0],
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing"),
        auto_views=False,
    )
