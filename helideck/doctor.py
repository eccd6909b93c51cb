"""What this machine offers: who draws the pictures, which versions, how many cores, what is missing."""

import ctypes
import json
import os
import platform
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

PROBE = Path(__file__).with_name("gl_probe.py")
PROBE_TIMEOUT = 120.0  # [s] a cold disk and a busy machine included

# Mesa's drivers that draw on the processor
SOFTWARE = ("llvmpipe", "softpipe", "swrast", "lavapipe", "software rasterizer", "swiftshader")

SHOWN = {
    "mujoco": "mujoco",
    "dm_control": "dm-control",
    "opencv": "opencv-python-headless",
    "numpy": "numpy",
    "scipy": "scipy",
    "numba": "numba",
    "filterpy": "filterpy",
    "control": "control",
    "rerun": "rerun-sdk",
}

LIBRARIES = {"libEGL.so.1": "libegl1", "libGL.so.1": "libgl1"}  # file: Debian's and Ubuntu's package


@dataclass(frozen=True)
class Drawing:
    """What came of the attempt to draw one small picture."""

    renderer: str | None  # GL_RENDERER; None where nothing could be drawn
    opengl: str | None  # GL_VERSION
    seconds: float | None  # [s] from model to picture, the start of OpenGL included
    error: str | None  # why nothing could be drawn

    @property
    def software(self) -> bool:
        """Whether the processor draws, not a graphics card."""
        return self.renderer is not None and any(name in self.renderer.lower() for name in SOFTWARE)


@dataclass(frozen=True)
class Report:
    """The machine at a glance."""

    drawing: Drawing
    versions: Mapping[str, str | None]  # None: not installed
    cores: int  # that this process may use
    memory: int  # [byte] of the machine
    warnings: tuple[str, ...]
    install: tuple[str, ...]  # what is missing, each with the command that brings it

    @property
    def can_render(self) -> bool:
        """Whether flights with cameras are possible here."""
        return self.drawing.renderer is not None


def doctor() -> Report:
    """Look at this machine; takes a second or two, most of it for the picture."""
    import joblib
    import psutil

    drawing = draw()
    cores = int(joblib.cpu_count())  # heeds affinity and a container's quota
    memory = int(psutil.virtual_memory().total)
    warnings = []
    if drawing.software:
        warnings.append(f"software rendering ({drawing.renderer}): the processor draws the pictures, a flight with "
                        "all cameras takes most of two cores")
    if cores < 2:
        warnings.append("one core only: a flight with all cameras will be slower than real time")
    if memory < 2 << 30:
        warnings.append(f"{memory / 2**30:.1f} GiB of memory: a flight with cameras needs up to 1 GiB")
    return Report(
        drawing=drawing,
        versions={"python": platform.python_version()} | {name: _version(package) for name, package in SHOWN.items()},
        cores=cores,
        memory=memory,
        warnings=tuple(warnings),
        install=(*_missing_libraries(), *_missing_packages(), *_missing_programs()),
    )


def draw(probe: Path = PROBE, timeout: float = PROBE_TIMEOUT) -> Drawing:
    """Draw one small picture in a process of its own: a driver that crashes or hangs takes only that down."""
    try:
        done = subprocess.run([sys.executable, "-I", str(probe)], capture_output=True, text=True, timeout=timeout,
                              env=os.environ | {"MUJOCO_GL": "egl"}, check=False)
    except subprocess.TimeoutExpired:
        return Drawing(None, None, None, f"drawing a small picture took more than {timeout:g} s")
    if done.returncode < 0:
        return Drawing(None, None, None, f"the OpenGL driver crashed ({signal.Signals(-done.returncode).name})")
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"drawing ended with code {done.returncode}"]
        return Drawing(None, None, None, lines[-1].strip())
    answer = json.loads(done.stdout.splitlines()[-1])
    return Drawing(answer["renderer"], answer["opengl"], answer["seconds"], None)


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _missing_libraries() -> list[str]:
    """OpenGL's libraries that cannot be loaded."""
    missing = []
    for file, package in LIBRARIES.items():
        try:
            ctypes.CDLL(file)
        except OSError:
            missing.append(package)
    return [f"{' and '.join(missing)}: make setup, or apt-get install {' '.join(missing)}"] if missing else []


def _missing_packages() -> list[str]:
    """Declared dependencies that are absent or of an unfit version."""
    from packaging.requirements import Requirement

    try:
        declared = requires("helideck") or []
    except PackageNotFoundError:
        return ["helideck itself is not installed in this environment: make setup"]
    unfit = []
    for requirement in map(Requirement, declared):
        if requirement.marker and not requirement.marker.evaluate({"extra": ""}):
            continue
        found = _version(requirement.name)
        if found is None or not requirement.specifier.contains(found, prereleases=True):
            unfit.append(f"{requirement.name}{requirement.specifier} (found: {found or 'none'}): make setup")
    return unfit


def _missing_programs() -> list[str]:
    """Programs that only a part needs."""
    if shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome"):
        return []
    return ["optional, to test the replay in a browser: apt-get install chromium"]
