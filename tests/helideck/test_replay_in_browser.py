"""Opens a recording in the web viewer, in a headless Chromium that draws in software, and looks at the picture."""

import os
import shutil
import subprocess
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec, Equipment
from flightlog.marks import HMark
from flightlog.readers import read_flight
from flightlog.recorder import Recorder, write_flight

PATIENCE = 90.0  # [s] on a busy machine without a GPU; measured: 8 s
ARGUMENTS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
]


@pytest.fixture
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="no playwright: `pip install playwright`")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or "/usr/bin/chromium"
    if not Path(chromium).exists():
        pytest.skip("no Chromium: `apt-get install chromium` brings the one that this test drives")
    node = Path(playwright.__file__).parents[1] / "driver" / "node"
    if subprocess.run([node, "--version"], capture_output=True, check=False).returncode:
        pytest.skip("playwright's driver does not start: `apt-get install libatomic1` brings what it lacks")
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=chromium, headless=True, args=ARGUMENTS)
        yield started
        started.close()


@pytest.fixture
def recording(tmp_path):
    """Four seconds above the pad, the down camera showing a bright blue picture with a found outline."""
    pytest.importorskip("rerun")
    from flightlog.replay import ReplayWriter

    spec = CameraSpec(25.0, 0.0, CameraModel.centred(160, 120, 200.0), CameraMount.downward(np.zeros(3)))
    equipment = Equipment({}, {"down": spec}, HMark(), 0.23, 157.0, 101325.0, 288.15, np.zeros(3))
    folder = tmp_path / "flight"
    with Recorder(folder) as recorder:
        write_flight(folder, {})
        for k in range(400):
            recorder.topic("truth", "state").append((k / 100, 0, 0, 3.0, *[0.0] * 9))
            recorder.topic("measured", "baro").append((k / 100, 1e5, 288.0, 3.0 + 0.5 * np.sin(k / 20)))
    flight = read_flight(folder)
    blue = np.zeros((120, 160, 3), np.uint8)
    blue[..., 2] = 255
    with ReplayWriter(folder / "replay.rrd", meshes={}, cameras={"down": spec}, equipment=equipment) as replay:
        for k in range(40):
            replay.add_frame("down", k / 10, blue, [np.array([[30.0, 30.0], [130.0, 30.0], [130.0, 90.0]])])
        replay.event(0.0, "hover")
        replay.finish(flight.measured, flight.truth)
    return folder / "replay.rrd"


def share(image, low, high):
    """Share of pixels whose red, green and blue all lie between the two."""
    return float(np.mean(np.all((image >= low) & (image <= high), axis=-1)))


def test_the_recording_appears_in_a_browser(recording, browser):
    from helideck.web_viewer import serve

    with serve(recording) as address:
        page = browser.new_page(viewport={"width": 1200, "height": 800})
        page.goto(f"{address}&renderer=webgl", wait_until="domcontentloaded")
        deadline = time.monotonic() + PATIENCE
        while True:
            time.sleep(1.0)
            png = page.screenshot(timeout=60_000)
            image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
            if "HELIDECK_SCREENSHOT" in os.environ:
                Path(os.environ["HELIDECK_SCREENSHOT"]).write_bytes(png)
            scene, side = image[60:450, :740], image[60:450, 760:]
            shares = {
                "night sky": share(scene, (10, 15, 24), (26, 32, 42)),
                "grass": share(scene, (20, 35, 25), (60, 90, 60)),
                "mark": share(scene, (225, 225, 225), (255, 255, 255)),
                "camera picture": share(side, (0, 0, 240), (20, 20, 255)),
                "outline": share(side, (60, 220, 110), (130, 255, 170)),
                "barometer curve": share(image[460:], (225, 100, 0), (255, 150, 40)),
            }
            wanted = {
                "night sky": 0.05,
                "grass": 0.1,
                "mark": 0.002,
                "camera picture": 0.2,
                "outline": 0.001,
                "barometer curve": 0.0003,
            }
            missing = {name: round(shares[name], 5) for name, least in wanted.items() if shares[name] < least}
            if not missing:
                return
            assert time.monotonic() < deadline, f"too little to be seen of {missing} after {PATIENCE:.0f} s"
