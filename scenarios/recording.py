"""The flight folder while it is flown: log, replay and flight.json together; or nothing at all."""

import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

from estimators.navigators import Navigator
from flightlog.errors import UserError
from flightlog.flight_json import write_flight
from flightlog.readers.folder import read_flight
from flightlog.recorder import Recorder
from flightlog.replay import ReplayWriter
from flightlog.signals import Controls, Frame, Measurement, StateEstimate
from scenarios.logbook import Logbook
from sim.shapes import vehicle_meshes
from sim.world import World

PICTURE_RATE = 5.0  # [Hz] of each camera in the replay
PACKAGES = ("helideck", "mujoco", "dm_control", "numpy", "scipy", "numba", "opencv-python-headless", "rerun-sdk")


class Recording(Protocol):
    """What the loop tells of itself."""

    def step(
        self, world: World, measurements: Sequence[Measurement], navigator: Navigator, state: StateEstimate,
        controls: Controls,
    ) -> None:  # fmt: skip
        """One step of the loop; `controls` are those that it has flown with."""
        ...

    def event(self, t: float, text: str, level: str = "INFO") -> None:
        """Something worth a line."""
        ...

    def conclude(self, flight: Mapping[str, Any]) -> None:
        """The flight is over; this is what was measured."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class Unrecorded:
    """Keeps nothing: campaigns."""

    def step(
        self, world: World, measurements: Sequence[Measurement], navigator: Navigator, state: StateEstimate,
        controls: Controls,
    ) -> None:  # fmt: skip
        """Let it pass."""

    def event(self, t: float, text: str, level: str = "INFO") -> None:
        """Let it pass."""

    def conclude(self, flight: Mapping[str, Any]) -> None:
        """Let it pass."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None


class FolderRecording:
    """Writes the flight folder of design section 3."""

    def __init__(
        self, folder: Path, world: World, navigator_equipment: Any, document: Mapping[str, Any], *, keep_frames: bool
    ) -> None:
        """Make the folder; UserError where it is in use."""
        self._document = dict(document)
        self._recorder = Recorder(folder)
        self._folder = folder
        write_flight(folder, self._document)
        self._logbook = Logbook(self._recorder, world, frames=keep_frames)
        seen = {name: spec for name, spec in world.cameras.items() if world.eyes is not None}
        self._replay = ReplayWriter(
            folder / "replay.rrd",
            meshes=vehicle_meshes(world.model),
            cameras=seen,
            equipment=navigator_equipment,
            picture_rate=PICTURE_RATE,
            title=str(document["scenario_name"]),
        )

    def step(
        self, world: World, measurements: Sequence[Measurement], navigator: Navigator, state: StateEstimate,
        controls: Controls,
    ) -> None:  # fmt: skip
        """One step into the log, pictures into the replay."""
        self._logbook.write(world, measurements, navigator.detections, state, controls)
        for sample in measurements:
            if type(sample) is Frame and self._replay.wants(sample.camera, sample.t):
                lines = navigator.overlays.get(sample.camera, ())
                self._replay.add_frame(sample.camera, sample.t, sample.image, lines)

    def event(self, t: float, text: str, level: str = "INFO") -> None:
        """A line among the replay's events."""
        self._replay.event(t, text, level)

    def conclude(self, flight: Mapping[str, Any]) -> None:
        """Put the summary into flight.json."""
        self._document["summary"] = flight
        write_flight(self._folder, self._document)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self._recorder.close()
            self._finish_replay()
            return
        # what ended the flight is the news: that something cannot be written must not hide it
        self._recorder.__exit__(kind, error, trace)
        try:
            self._finish_replay()
        except (UserError, OSError, RuntimeError):
            self._replay.file.unlink(missing_ok=True)  # `helideck replay` makes it anew from the tables

    def _finish_replay(self) -> None:
        try:
            tables = read_flight(self._folder)
            self._replay.finish(tables.measured, tables.truth)
        finally:
            self._replay.close()


def versions() -> dict[str, str]:
    """What flew, in software."""
    return {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}}
