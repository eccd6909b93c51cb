"""The render process: `python -m sim.cameras.child CONNECTION_FD MEMORY_FD`; started by `rendering` alone."""

import mmap
import os
import sys
import time
from multiprocessing.connection import Connection

import numpy as np


def main() -> int:
    """Serve requests until the other end closes."""
    connection, memory = Connection(int(sys.argv[1])), int(sys.argv[2])
    start = time.perf_counter()
    try:
        scene, imaging, seed, slot_bytes = connection.recv()
        import cv2

        from sim.cameras.renderer import Renderer

        cv2.setNumThreads(1)
        renderer = Renderer(scene, imaging, seed)
    except Exception as error:  # whatever it is, the parent has to hear of it
        connection.send(("error", _line(error)))
        return 1
    shared = np.frombuffer(mmap.mmap(memory, os.fstat(memory).st_size), np.uint8)
    with renderer:
        connection.send(("ready", renderer.name, time.perf_counter() - start))
        while True:
            try:
                job = connection.recv()
            except EOFError:
                return 0  # the parent is gone
            if job is None:
                return 0
            slot, request = job
            began, worked = time.perf_counter(), time.process_time()
            try:
                picture = renderer.frame(request)
            except Exception as error:
                connection.send(("error", _line(error)))
                return 1
            shared[slot * slot_bytes : slot * slot_bytes + picture.size] = picture.ravel()
            spent = (time.perf_counter() - began, time.process_time() - worked)
            connection.send(("frame", slot, picture.shape, spent))


def _line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if type(error).__name__ == "RenderError" else f"{type(error).__name__}: {text}"


if __name__ == "__main__":
    sys.exit(main())
