"""The rerun viewer in the browser, on loopback only."""

import contextlib
import shutil
import socket
import subprocess
import threading
import time
import urllib.request
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from pathlib import Path

from flightlog.errors import UserError

LOOPBACK = "127.0.0.1"
START_LIMIT = 20.0  # [s] for the viewer's server to answer


def viewer_binary() -> Path:
    """The viewer that comes with rerun-sdk.

    Its Python wrapper is passed over: ended, it would leave the viewer running.
    """
    found = find_spec("rerun_cli")
    if found is None or found.origin is None:
        raise UserError("rerun is not installed; `pip install rerun-sdk` brings the viewer")
    folder = Path(found.origin).parent
    for name in ("rerun", "rerun.exe", "Rerun.app/Contents/MacOS/Rerun"):
        if (folder / name).is_file():
            return folder / name
    raise UserError(f"{folder}: the rerun viewer is missing; `pip install --force-reinstall rerun-sdk` brings it back")


@contextlib.contextmanager
def serve(recording: Path, port: int = 0) -> Iterator[str]:
    """Serve viewer and recording on loopback for as long as the context lasts; yields the address to open.

    The viewer's pages come from rerun's own server. Started without an address to serve it would listen on all
    interfaces and keep a core busy with a message proxy; given the recording's address it only serves pages, and
    `--bind` holds it on loopback. The recording comes from a server of ours that knows this one file.

    Args:
        recording: the .rrd file.
        port: of the viewer's pages; 0 for any that is free.
    """
    if not recording.is_file():
        raise UserError(f"{recording}: no such file; a flight's recording is replay.rrd")
    port = _free_port(port)
    files = ThreadingHTTPServer((LOOPBACK, 0), _handler(recording, f"http://{LOOPBACK}:{port}"))
    threading.Thread(target=files.serve_forever, name="recording", daemon=True).start()
    source = f"http://{LOOPBACK}:{files.server_address[1]}/{recording.name}"
    command = [str(viewer_binary()), "--serve-web", "--bind", LOOPBACK, "--web-viewer-port", str(port), source]
    viewer = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        page = f"http://{LOOPBACK}:{port}/"
        _await(viewer, page)
        yield f"{page}?url={source}"
    finally:
        viewer.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            viewer.wait(5.0)
        viewer.kill()
        viewer.wait()
        files.shutdown()
        files.server_close()


def _free_port(port: int) -> int:
    """`port` itself if nothing listens there, any free one for 0."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except (OSError, OverflowError):
            raise UserError(f"--port {port}: not free; leave it out for any that is") from None
        return int(probe.getsockname()[1])


def _await(viewer: "subprocess.Popen[bytes]", page: str) -> None:
    """Return once the viewer's server answers."""
    said: list[str] = []
    threading.Thread(target=_drain, args=(viewer, said), daemon=True).start()
    deadline = time.monotonic() + START_LIMIT
    while time.monotonic() < deadline:
        if viewer.poll() is not None:
            raise UserError(f"the rerun viewer's server ended at once: {' '.join(said)[-300:].strip() or 'no reason'}")
        with contextlib.suppress(OSError), urllib.request.urlopen(page, timeout=2.0):
            return
        time.sleep(0.05)
    raise UserError(f"the rerun viewer's server does not answer at {page} after {START_LIMIT:.0f} s")


def _drain(viewer: "subprocess.Popen[bytes]", said: list[str]) -> None:
    """Keep reading what the viewer says, so that a full pipe never stops it."""
    assert viewer.stderr is not None
    for line in viewer.stderr:
        said.append(line.decode(errors="replace").strip())
        del said[:-20]


def _handler(recording: Path, origin: str) -> type[BaseHTTPRequestHandler]:
    class Recording(BaseHTTPRequestHandler):
        """Gives out one file, to the viewer's pages."""

        def do_GET(self) -> None:
            if self.path.partition("?")[0] != f"/{recording.name}":
                self.send_error(404)
                return
            try:
                file = recording.open("rb")
            except OSError:
                self.send_error(404)
                return
            with file, contextlib.suppress(ConnectionError):
                self.send_response(200)
                self.send_header("Content-Type", "application/octet-stream")
                self.send_header("Content-Length", str(recording.stat().st_size))
                self.send_header("Access-Control-Allow-Origin", origin)
                self.send_header("Access-Control-Expose-Headers", "*")
                self.end_headers()
                shutil.copyfileobj(file, self.wfile, 1 << 20)

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    return Recording
