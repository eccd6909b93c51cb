import json
import os
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request

import psutil
import pytest

from flightlog.recorder import Recorder, write_flight
from helideck.cli import main

pytest.importorskip("rerun", reason="the replay needs rerun-sdk")


@pytest.fixture
def flight(tmp_path):
    """A flight with a log, but without a recording."""
    folder = tmp_path / "flight"
    with Recorder(folder) as recorder:
        write_flight(folder, {})
        for k in range(100):
            recorder.topic("measured", "estimate").append((k / 50, *[0.0] * 21))
    return folder


@pytest.fixture
def served(flight):
    process = subprocess.Popen(
        [sys.executable, "-c", "import sys; from helideck.cli import main; sys.exit(main())"]
        + ["replay", str(flight), "--web"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    yield process, process.stdout.readline().strip()
    process.terminate()  # killed, it could not end its viewer
    process.communicate(timeout=10.0)


def test_web_serves_viewer_and_recording_on_loopback_alone_and_ends_with_its_viewer(served, flight):
    process, address = served
    page, source = re.fullmatch(
        r"(http://127\.0\.0\.1:\d+/)\?url=(http://127\.0\.0\.1:\d+/replay\.rrd)", address
    ).groups()
    with urllib.request.urlopen(page) as answer:
        assert b"<html" in answer.read()
    with urllib.request.urlopen(source) as answer:
        assert answer.read() == (flight / "replay.rrd").read_bytes()
        assert answer.headers["Access-Control-Allow-Origin"] == page.rstrip("/")
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(source.replace("replay.rrd", "flight.json"))
    ours = psutil.Process(process.pid)
    family = [ours, *ours.children(recursive=True)]
    listening = [c for p in family for c in p.net_connections() if c.status == psutil.CONN_LISTEN]
    assert len(listening) == 2
    assert {c.laddr.ip for c in listening} == {"127.0.0.1"}
    process.send_signal(signal.SIGTERM)
    assert process.wait(10.0) == 0
    assert psutil.wait_procs(family, timeout=5.0)[1] == []


def test_a_missing_recording_is_made_from_the_tables(served, flight):
    assert (flight / "replay.rrd").stat().st_size > 1000


def test_a_killed_flight_is_shown_from_its_log_and_keeps_its_pictures(tmp_path):
    from helideck.cli.replay import _recording

    recorder = Recorder(tmp_path / "flight")
    write_flight(tmp_path / "flight", {})
    recorder.topic("measured", "estimate").append((0.0, *[0.0] * 21))
    recorder.flush()
    (tmp_path / "flight/replay.rrd").write_bytes(b"half a recording")
    made = _recording(tmp_path / "flight")
    assert made.name == "replay-from-log.rrd"
    assert made.stat().st_size > 1000
    assert (tmp_path / "flight/replay.rrd").read_bytes() == b"half a recording"


def test_a_folder_that_is_no_flight_is_unusable_input(tmp_path, capsys):
    assert main(["replay", str(tmp_path), "--json"]) == 2
    said = capsys.readouterr()
    assert "flight.json is missing" in json.loads(said.out)["error"]


def test_a_port_in_use_is_told(flight, capsys):
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["replay", str(flight), "--web", "--port", str(port)]) == 2
    assert f"--port {port}: not free" in capsys.readouterr().err


def test_without_a_display_web_is_named(flight, capsys, monkeypatch):
    if not sys.platform.startswith("linux"):
        pytest.skip("other systems always have a display")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert main(["replay", str(flight)]) == 2
    assert "--web" in capsys.readouterr().err
    assert os.environ.get("DISPLAY") is None
