"""`helideck replay`."""

import os
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from tyro.conf import Positional

from flightlog.errors import UserError
from helideck.cli.document import emit


@dataclass(frozen=True)
class Replay:
    """Look at a flight: opens its recording in the rerun viewer.

    Example: helideck replay flights/landing-1 --web
    """

    flight: Positional[Path]
    """Folder of the flight."""
    web: bool = False
    """Serve the viewer on loopback and print the address, until Ctrl-C."""
    port: int = 0
    """Port of the viewer's page; 0: any that is free. With --web."""
    json: bool = False
    """One JSON document on stdout."""

    def run(self) -> int:
        """Open the viewer, or serve it."""
        from helideck.web_viewer import serve, viewer_binary

        if self.port and not self.web:
            raise UserError(f"--port {self.port} goes with --web")
        recording = _recording(self.flight)
        if not self.web:
            if sys.platform.startswith("linux") and not (
                os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
            ):
                raise UserError("there is no display here; `--web` serves the viewer to a browser")
            if self.json:
                emit({"flight": self.flight, "recording": recording, "url": None})
            return 0 if subprocess.call([str(viewer_binary()), str(recording)]) == 0 else 1
        # ended by a signal, the viewer's server must end as well
        signal.signal(signal.SIGTERM, _interrupt)
        with serve(recording, self.port) as address:
            if self.json:
                emit({"flight": self.flight, "recording": recording, "url": address})
                sys.stdout.flush()
            else:
                print(address, flush=True)
                print("open it in a browser; Ctrl-C ends", file=sys.stderr)
            try:
                threading.Event().wait()
            except KeyboardInterrupt:
                return 0
        return 0


def _recording(flight: Path) -> Path:
    """The flight's replay.rrd; one made from its tables where it is missing or has no curves, the flight killed."""
    from flightlog.flight_json import read_flight_json
    from flightlog.readers import read_flight

    read_flight_json(flight)
    recording = flight / "replay.rrd"
    killed = any(flight.glob("*/*.arrows"))
    if recording.is_file() and not killed:
        return recording
    from flightlog.replay import ReplayWriter

    made = flight / "replay-from-log.rrd" if recording.is_file() else recording
    why = "the flight was broken off" if killed else "no replay.rrd"
    print(f"{flight}: {why}: shown from the log, without pictures", file=sys.stderr)
    tables = read_flight(flight)
    with ReplayWriter(made, meshes={}, cameras={}, title=flight.name) as replay:
        replay.finish(tables.measured, tables.truth)
    return made


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
