"""Rendering in a process of its own, so that the simulation goes on while a picture is drawn.

The process is started by its module's name rather than by multiprocessing's spawn, which would run a user's script a
second time. Requests travel through a socket, pictures through memory that both processes map; it belongs to nobody's
file system, so a killed flight leaves nothing behind.
"""

import mmap
import os
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Mapping
from multiprocessing import Pipe
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sim.cameras import RenderError
from sim.cameras.imaging import Imaging
from sim.cameras.request import FrameRequest
from sim.scene import CompiledScene

SLOTS = 16  # pictures that may be under way


class RenderProcess:
    """Renders a scene's cameras elsewhere, in the order of `submit`. Use it as a context manager.

    It starts at once and gets ready in the background; `wait` (or the first `collect`) waits for it.
    """

    def __init__(
        self,
        scene: CompiledScene,
        imaging: Mapping[str, Imaging] | None = None,
        seed: int = 0,
        threads: int = 0,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """imaging: by camera, default where missing; seed: of camera noise; threads: of Mesa, 0 draws in the caller's.

        environment: further variables for the process.
        """
        self.renderer = ""  # GL_RENDERER, once ready
        self.startup_s = 0.0  # [s] until ready
        self.busy_s = 0.0  # [s] spent drawing and developing, by the clock
        self.cpu_s = 0.0  # [s] the same in processor time, which other programs do not lengthen
        self._ready = False
        self._waiting: deque[tuple[int, FrameRequest]] = deque()
        self._free = deque(range(SLOTS))
        shapes = [spec.model for spec in scene.cameras.values()]
        self._slot_bytes = max((m.width * m.height * 3 for m in shapes), default=1)
        size = SLOTS * self._slot_bytes
        memory = os.memfd_create("helideck-pictures", os.MFD_CLOEXEC)
        os.ftruncate(memory, size)
        self._shared = np.frombuffer(mmap.mmap(memory, size), np.uint8)
        self._said = tempfile.TemporaryFile()  # noqa: SIM115  closed with the process
        self._connection, far_end = Pipe()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "sim.cameras.child", str(far_end.fileno()), str(memory)],
            env=_environment(threads) | dict(environment or {}),
            pass_fds=(far_end.fileno(), memory),
            stdin=subprocess.DEVNULL,
            stdout=self._said,
            stderr=self._said,
            process_group=0,  # Ctrl-C is for the parent, which still wants its last pictures
        )
        far_end.close()
        os.close(memory)
        try:
            self._connection.send((scene, dict(imaging or {}), seed, self._slot_bytes))
        except OSError:
            self._fail()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def pending(self) -> int:
        """How many pictures were submitted and not collected yet."""
        return len(self._waiting)

    def wait(self) -> None:
        """Return when the process is ready to draw."""
        if not self._ready:
            _, self.renderer, self.startup_s = self._receive()
            self._ready = True

    def submit(self, request: FrameRequest) -> None:
        """Ask for a picture."""
        if not self._free:
            raise RenderError(f"{SLOTS} pictures are under way already: collect some first")
        slot = self._free.popleft()
        try:
            self._connection.send((slot, request))
        except OSError:
            self._fail()
        self._waiting.append((slot, request))

    def collect(self) -> tuple[FrameRequest, NDArray[np.uint8]]:
        """The oldest request not collected yet with its picture (H, W) or (H, W, 3), waiting for it if need be."""
        if not self._waiting:
            raise RenderError("no picture was asked for")
        self.wait()
        _, slot, shape, (seconds, cpu) = self._receive()
        expected, request = self._waiting.popleft()
        if slot != expected:
            raise RenderError(f"picture in slot {slot} where {expected} was due")
        self.busy_s += seconds
        self.cpu_s += cpu
        start = slot * self._slot_bytes
        picture = self._shared[start : start + int(np.prod(shape))].reshape(shape).copy()
        self._free.append(slot)
        return request, picture

    def close(self) -> None:
        """End the process."""
        if self._connection.closed:
            return
        self._connection.close()  # the process ends when it next listens
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._said.close()

    def _receive(self) -> Any:
        try:
            answer = self._connection.recv()
        except (EOFError, OSError):
            self._fail()
        if answer[0] == "error":
            self.close()
            raise RenderError(answer[1])
        return answer

    def _fail(self) -> None:
        """The process is gone: say with which code and its last words."""
        code = self._process.wait()
        self._said.seek(0)
        words = self._said.read().decode(errors="replace").strip().splitlines()
        self.close()
        raise RenderError(f"the render process ended with code {code}" + (f": {words[-1]}" if words else ""))


def _environment(threads: int) -> dict[str, str]:
    """The child's environment: headless OpenGL, the parent's import path, one core."""
    env = dict(os.environ)
    env.setdefault("MUJOCO_GL", "egl")
    env["PYTHONPATH"] = os.pathsep.join(os.path.abspath(p) for p in sys.path)
    env |= {"LP_NUM_THREADS": str(threads), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return env
