"""`helideck land`: its document, its exit codes, its folder, and what is left when it is broken off."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from flightlog.flight_json import read_flight_json
from flightlog.readers import read_flight
from helideck.cli import main

ROOT = Path(__file__).parents[2]
KEYS = [
    "scenario", "seed", "vehicle", "success", "landed", "reason", "touchdown_offset_m", "touchdown_east_m",
    "touchdown_north_m", "touchdown_sink_m_s", "touchdown_drift_m_s", "late_speed_max_m_s", "max_roll_deg",
    "max_pitch_deg", "fused_height_mean_error_m", "fused_height_max_error_m", "fused_height_std_m",
    "sensor_height_error_m", "duration_s", "wall_s", "startup_s", "real_time_factor", "renderer", "flight",
]  # fmt: skip


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def land(capsys, here):
    """Run `helideck land` in this process; exit code, stdout, stderr."""

    def run(*words):
        capsys.readouterr()
        code = main(["land", "--no-cameras", *words])
        out = capsys.readouterr()
        return code, out.out, out.err

    return run


def strict(text):
    """The document, where it is one that RFC 8259 knows."""
    return json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))


def started(*words, environment=None, **keywords):
    """`helideck` in a process of its own, without a display, without a choice of OpenGL."""
    chosen = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "MUJOCO_GL")}
    command = [sys.executable, "-c", "import sys; from helideck.cli import main; sys.exit(main())", *words]
    return subprocess.Popen(
        command, env=chosen | {"PYTHONPATH": str(ROOT)} | (environment or {}), stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, **keywords,
    )  # fmt: skip


def flying(process, folder, limit=90.0):
    """Return once the log has grown beyond its first second."""
    until = time.monotonic() + limit
    while time.monotonic() < until:
        assert process.poll() is None, process.communicate()
        log = folder / "measured" / "imu.arrows"
        if log.is_file() and log.stat().st_size > 60_000:
            return
        time.sleep(0.02)
    pytest.fail("it did not take off")


# --- documents and exit codes -----------------------------------------------------------------------------------------


def test_a_landing_is_success_and_one_document_with_the_promised_keys(land, here):
    code, out, err = land("--json", "--seed", "3")
    document = strict(out)
    assert list(document) == KEYS
    assert code == 0 and document["success"] is True and document["landed"] is True
    assert err == ""
    assert document["flight"] == "flights/landing-3"
    assert document["renderer"] is None and document["seed"] == 3 and document["vehicle"] == "raptor90"
    for spread in document["sensor_height_error_m"].values():
        assert list(spread) == ["mean", "max", "std"]
    assert list(document["sensor_height_error_m"]) == ["baro", "gps", "vision", "sonar"]
    assert read_flight_json(here / "flights" / "landing-3")["summary"]["summary"]["landed"] is True
    assert document["real_time_factor"] == pytest.approx(document["duration_s"] / document["wall_s"], rel=1e-6)


def test_a_flight_that_fails_has_the_same_document_and_exit_code_1(land):
    code, out, _ = land("--json", "--set", "duration_s=1")
    document = strict(out)
    assert list(document) == KEYS
    assert code == 1
    assert document["success"] is False and document["landed"] is False and document["reason"] == "time is up"
    assert document["touchdown_offset_m"] is None and document["sensor_height_error_m"]["sonar"] is None


def test_for_people_it_prints_a_table_and_where_the_flight_is(land):
    code, out, err = land("--set", "duration_s=1", "-o", "mine")
    assert code == 1 and err == ""
    assert "landing, seed 0: no success: time is up" in out
    assert "fused height" in out and "baro alone" in out and "helideck replay mine" in out


def test_unusable_input_is_a_document_too(land):
    code, out, err = land("nowhere", "--json")
    assert code == 2
    assert err == f"helideck: {strict(out)['error']}\n"


def test_folders_are_numbered_and_an_existing_one_is_refused(land, here):
    quick = ("--set", "duration_s=0.6")
    for folder in ("landing-0", "landing-0-2", "landing-0-3"):
        land(*quick)
        assert (here / "flights" / folder / "flight.json").is_file()
    land(*quick, "--seed", "4:2")
    assert read_flight_json(here / "flights" / "landing-4-2")["seed"] == [4, 2]
    (here / "empty").mkdir()
    for name in ("empty", "flights/landing-0"):
        code, _, err = land("-o", name)
        assert code == 2 and err == f"helideck: {name}: exists already; name a folder that is new\n"
    assert not list((here / "empty").iterdir())


def test_a_run_of_a_campaign_flies_again_with_its_seed(land):
    once, again = (strict(land("--json", "--seed", "4:2", "--set", "duration_s=1")[1]) for _ in range(2))
    different = ("wall_s", "startup_s", "real_time_factor", "flight")
    assert {k: v for k, v in once.items() if k not in different} == {
        k: v for k, v in again.items() if k not in different
    }


# --- flights that are broken off --------------------------------------------------------------------------------------

LONG = ("land", "hover", "--no-cameras", "--set", "duration_s=3000", "-o", "flight")


def test_without_a_display_nothing_is_said_and_no_opengl_is_needed(here):
    hidden = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent", "LIBGL_DRIVERS_PATH": "/nonexistent"}
    done = started("land", "--no-cameras", "--json", "--set", "duration_s=1", environment=hidden, cwd=here)
    out, err = done.communicate(timeout=120)
    assert err == ""
    assert done.returncode == 1 and strict(out)["reason"] == "time is up"


def test_without_egl_pictures_are_refused_with_what_to_install(here, monkeypatch, capsys):
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    assert main(["land", "-o", "flight"]) == 2
    out = capsys.readouterr()
    assert out.err.count("\n") == 1
    for words in ("no headless OpenGL", "apt install libegl1 libgl1", "helideck doctor", "--no-cameras"):
        assert words in out.err
    assert not (here / "flight").exists()


def test_ctrl_c_keeps_the_log_so_far(here):
    process = started(*LONG, "--json", cwd=here)
    flying(process, here / "flight")
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err == "helideck: interrupted; the log up to there is in flight\n"
    document = strict(out)
    assert list(document) == KEYS and document["reason"] == "interrupted" and document["success"] is False
    assert read_flight_json(here / "flight")["summary"]["summary"]["reason"] == "interrupted"
    flight = read_flight(here / "flight")
    assert flight.notes == []
    assert flight.measured["imu"]["t"][-1] == pytest.approx(document["duration_s"], abs=0.01)
    assert flight.truth["state"]["t"][-1] == pytest.approx(document["duration_s"], abs=0.02)
    assert (here / "flight" / "replay.rrd").is_file()


def test_killed_at_once_it_is_readable_to_its_last_second(here):
    process = started(*LONG, cwd=here)
    flying(process, here / "flight")
    process.kill()
    process.communicate(timeout=60)
    flight = read_flight(here / "flight")
    last = {name: float(table["t"][-1]) for name, table in flight.measured.items()}
    assert last["imu"] > 1.0
    assert min(last.values()) > last["imu"] - 2.1, last  # a second of the log, and a flush that came in between
    assert flight.document["scenario"]["duration_s"] == 3000
    assert any("broken off" in note for note in flight.notes)


def test_a_full_disk_ends_the_flight_in_one_line_and_keeps_what_is_written(here):
    """A limit on the size of files stands in for the disk's end."""
    import resource

    limit = 300_000
    process = started(
        *LONG, cwd=here, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    )  # fmt: skip
    _, err = process.communicate(timeout=120)
    assert process.returncode == 2
    lines = [line for line in err.splitlines() if line.startswith("helideck: ")]
    assert len(lines) == 1 and "cannot be written" in lines[0] and "stays readable" in lines[0]
    assert "Traceback" not in err
    flight = read_flight(here / "flight")
    assert len(flight.measured["imu"]) > 500


@pytest.mark.render
def test_a_render_process_that_dies_in_flight_ends_it_in_one_line(here):
    process = started("land", "--json", "-o", "flight", cwd=here)
    flying(process, here / "flight", limit=180.0)
    (renderer,) = [child for child in psutil.Process(process.pid).children(recursive=True)
                   if "sim.cameras.child" in child.cmdline()]  # fmt: skip
    renderer.kill()
    out, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert err.count("\n") == 1 and "the render process ended with code -9" in err and "is in flight" in err
    document = strict(out)
    assert list(document) == KEYS and "render process" in document["reason"]
    assert len(read_flight(here / "flight").measured["imu"]) > 250
