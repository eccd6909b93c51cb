"""Writes replay.rrd: the flight as one can look at it in rerun.

Pictures and events are logged as they come; everything else is taken from the log's tables at the end, in whole
columns, which costs a thousandth of logging it value by value. Importing this module imports rerun: do it late.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from flightlog.equipment import CameraSpec, Equipment
from flightlog.errors import UserError
from flightlog.replay_layout import CHASE, COLOURS, PALETTE, TIMELINE, blueprint
from flightlog.replay_order import pictures_last
from flightlog.replay_scene import Mesh, disc, log_cameras, log_scene, visible
from flightlog.replay_series import RPM, Attitude, Series, height_errors, heights, path, thin
from flightlog.tables import Table

Floats = NDArray[np.float64]
RATE = 50.0  # [Hz] of motion and curves; finer than a display shows
TRAIL_RATE = 10.0  # [Hz]
JUMP = 20.0  # [m/s] faster than any vehicle here: a path has a gap
FOUND = (90, 255, 140)  # colour of what vision found


class ReplayWriter:
    """A context manager that writes one recording."""

    def __init__(
        self,
        file: Path,
        *,
        meshes: Mapping[str, Mesh],
        cameras: Mapping[str, CameraSpec],
        equipment: Equipment | None = None,
        rotor: tuple[Sequence[float], float] | None = None,
        picture_rate: float = 10.0,
        title: str = "flight",
    ) -> None:
        """Start the recording with all that stands still.

        Args:
            file: replay.rrd.
            meshes: the vehicle's parts by name, in body axes.
            cameras: those of which pictures will come.
            equipment: the sensors as fitted; with it, heights in the plots are the body origin's.
            rotor: hub (3,) [m] in body axes and radius [m] of a translucent disc; None where a mesh shows it.
            picture_rate: [Hz] at most, per camera; further pictures are passed over.
            title: name of the recording in the viewer.
        """
        self.file = Path(file)
        self.cameras = dict(cameras)
        self.equipment = equipment
        self._spacing = 1.0 / picture_rate - 1e-6
        self._last: dict[str, float] = {}
        self._closed = False
        self._layout = blueprint({name: spec.model for name, spec in self.cameras.items()})
        self._rec = rr.RecordingStream("helideck", send_properties=False)
        try:
            self._rec.save(self.file, default_blueprint=self._layout)
        except RuntimeError as error:
            raise UserError(f"{self.file}: cannot be written: {str(error).splitlines()[0]}") from None
        self._rec.send_recording_name(title)
        parts = dict(meshes)
        if rotor is not None:
            hub, radius = rotor
            parts["rotor_disc"] = (*disc(np.asarray(hub, float), radius), (0.75, 0.8, 0.9, 0.15))
        log_scene(self._rec, parts, equipment.mark if equipment is not None else None)
        log_cameras(self._rec, self.cameras)
        for name in self.cameras:
            self._rec.log(
                f"cameras/{name}/seen", rr.LineStrips2D.from_fields(colors=[FOUND], radii=[-1.5]),
                static=True,
            )  # fmt: skip

    def wants(self, camera: str, t: float) -> bool:
        """Whether a picture of this time would be kept."""
        return camera in self.cameras and t - self._last.get(camera, -np.inf) >= self._spacing

    def add_frame(
        self, camera: str, t: float, image: NDArray[np.uint8], overlay: Sequence[Floats] = (), quality: int = 80
    ) -> None:
        """Keep a picture and what vision found in it, unless the last one of the camera is too recent.

        Args:
            camera: its name.
            t: time of validity [s].
            image: (H, W) grey or (H, W, 3) RGB, uint8.
            overlay: lines to draw, each (N, 2) [px], pixel centres at integers.
            quality: of the JPEG, 0 to 100.
        """
        if not self.wants(camera, t):
            return
        self._last[camera] = t
        picture = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
        _, jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
        self._rec.set_time(TIMELINE, duration=t)
        self._rec.log(f"cameras/{camera}", rr.EncodedImage(contents=jpeg.tobytes(), media_type="image/jpeg"))
        height, width = image.shape[:2]
        # no lines takes away the last ones
        strips = [piece for line in overlay for piece in visible(line, width, height)]
        self._rec.log(f"cameras/{camera}/seen", rr.LineStrips2D.from_fields(strips=strips))

    def event(self, t: float, text: str, level: str = "INFO") -> None:
        """Put a line into the events: `level` is INFO, WARN or ERROR."""
        self._rec.set_time(TIMELINE, duration=t)
        self._rec.log("events", rr.TextLog(text, level=level))

    def finish(self, measured: Mapping[str, Table], truth: Mapping[str, Table]) -> None:
        """Add motion, paths and curves from the log's tables."""
        self._motion(measured, truth)
        found = heights(measured, truth, self.equipment)
        self._plot("height", found, "m")
        self._plot("height_error", height_errors(found), "m")
        if "estimate" in measured:
            self._flown("fusion", measured["estimate"])
        if "state" in truth:
            self._flown("truth", truth["state"])
        if "controls" in measured:
            table = measured["controls"]
            for name, colour in zip(table.columns[1:], PALETTE, strict=False):
                place, scale = ("throttle", 1.0) if table.unit(name) == "1" else ("controls", np.degrees(1.0))
                self._curve(f"{place}/{name}", table["t"], table[name] * scale, colour, name)
        if "rotor" in measured:
            table = measured["rotor"]
            self._curve("rotor/measured", table["t"], table["speed"] * RPM, COLOURS["fusion"], "measured")
        if "rotor" in truth:
            table = truth["rotor"]
            self._curve("rotor/truth", table["t"], table["speed"] * RPM, COLOURS["truth"], "true")

    def close(self) -> None:
        """Write what is left, and put it in an order that is good to read."""
        if self._closed:
            return
        self._closed = True
        self._rec.flush()
        self._rec.disconnect()
        if self._last:
            pictures_last(self.file, self._layout, "cameras")

    def __enter__(self) -> "ReplayWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _motion(self, measured: Mapping[str, Table], truth: Mapping[str, Table]) -> None:
        """The vehicle as it moved (as it believes to have, without truth), and both paths."""
        table = truth.get("state") or measured.get("estimate")
        if table is not None and len(table):
            t, points = path(table, RATE)
            turns = Attitude(table).at(t).as_quat()
            times = [rr.TimeColumn(TIMELINE, duration=t)]
            self._rec.send_columns(
                "world/vehicle",
                indexes=times,
                columns=rr.Transform3D.columns(translation=points, quaternion=turns),
            )
            self._rec.send_columns(CHASE, indexes=times, columns=rr.Transform3D.columns(translation=points))
        for name, source, colour in (
            ("true", truth.get("state"), (235, 235, 235)),
            ("fused", measured.get("estimate"), COLOURS["fusion"]),
        ):
            if source is None:
                continue
            t, points = path(source, TRAIL_RATE)
            if len(t) < 2:
                continue
            place = f"world/path/{name}"
            self._rec.log(place, rr.LineStrips3D.from_fields(colors=[colour], radii=[0.006]), static=True)
            pieces = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
            # an estimate that jumps, such as with its first fix, has not flown there
            flown = np.linalg.norm(np.diff(points, axis=0), axis=1) < JUMP * np.diff(t)
            self._rec.send_columns(
                place,
                indexes=[rr.TimeColumn(TIMELINE, duration=t[1:][flown])],
                columns=rr.LineStrips3D.columns(strips=list(pieces[flown])),
            )

    def _flown(self, name: str, table: Table) -> None:
        """Curves of a table with position, velocity and attitude; east bright, north dim."""
        t = table["t"]
        bright = COLOURS[name]
        dim = tuple(int(0.6 * c) for c in bright)
        for group, pair in (("position", ("e", "n")), ("velocity", ("ve", "vn")), ("attitude", ("roll", "pitch"))):
            scale = np.degrees(1.0) if group == "attitude" else 1.0
            for column, colour in zip(pair, (bright, dim), strict=True):
                self._curve(f"{group}/{column}_{name}", t, table[column] * scale, colour, f"{column} {name}")
        self._curve(f"climb/{name}", t, table["vu"], bright, name)

    def _plot(self, group: str, found: Mapping[str, Series], unit: str) -> None:
        for name, series in found.items():
            points = name not in ("truth", "fusion")
            self._curve(f"{group}/{name}", series.t, series.values, COLOURS[name], name, points=points)

    def _curve(
        self, place: str, t: Floats, values: Floats, colour: Sequence[int], name: str, *, points: bool = False
    ) -> None:
        good = np.isfinite(values)
        t, values = t[good], values[good]
        chosen = thin(t, RATE)
        if not len(chosen):
            return
        style = (
            rr.SeriesPoints(colors=[colour], names=name, markers="circle", marker_sizes=[1.5])
            if points
            else rr.SeriesLines(colors=[colour], names=name, widths=[1.5])
        )
        self._rec.log(place, style, static=True)
        self._rec.send_columns(
            place,
            indexes=[rr.TimeColumn(TIMELINE, duration=t[chosen])],
            columns=rr.Scalars.columns(scalars=values[chosen]),
        )
