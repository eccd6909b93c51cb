"""What a picture costs, camera by camera, in the render process as it flies.

python benchmarks/rendering.py [--json] [pictures each, default 60] [threads of Mesa, default 0]

Processor time, because other programs on the machine do not lengthen it. "all" is what 25 down and two times 10 forward
pictures a second add up to.
"""

import json
import statistics
import sys
from collections.abc import Iterator

import numpy as np

from flightlog.marks import HMark
from flightlog.rotations import quaternion
from sim import vehicle
from sim.cameras.imaging import Imaging
from sim.cameras.rendering import RenderProcess
from sim.cameras.request import FrameRequest
from sim.light import Light
from sim.scene import compose

HEIGHTS = (15.0, 10.0, 4.0, 1.0)  # [m]


def poses(height: float, count: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Positions and velocities (9,), (8,) of a vehicle that hovers unsteadily near the mark."""
    rng = np.random.default_rng(0)
    for _ in range(count):
        place = np.append(rng.normal(0.0, 0.05 * height, 2), height)
        turn = quaternion(*rng.normal(0.0, 0.04, 2), rng.uniform(0.0, 2 * np.pi))
        speed = rng.normal(0.0, [0.5, 0.5, 0.3, 0.3, 0.3, 0.3])
        yield np.concatenate([place, turn, [0.0, 0.0]]), np.append(speed, [0.0, 0.0])


def measure(scene_name: str, count: int, threads: int) -> dict[str, object]:
    """Median processor and clock time [ms] of a picture by camera and height."""
    raptor = vehicle.load("raptor90")
    scene = compose(raptor.model, scene_name, HMark(), raptor.cameras, Light())
    imaging = {"down": Imaging(colour=False)}
    rows = []
    with RenderProcess(scene, imaging, threads=threads) as process:
        process.wait()
        for camera in scene.cameras:
            for height in HEIGHTS:
                cpu, wall = [], []
                for index, (qpos, qvel) in enumerate(poses(height, count)):
                    before = process.cpu_s, process.busy_s
                    process.submit(FrameRequest(camera, 0.0, index, qpos, qvel, Light()))
                    process.collect()
                    cpu.append(1e3 * (process.cpu_s - before[0]))
                    wall.append(1e3 * (process.busy_s - before[1]))
                rows.append({"camera": camera, "height_m": height, "cpu_ms": round(statistics.median(cpu), 2),
                             "wall_ms": round(statistics.median(wall), 2)})  # fmt: skip
        mean = {c: statistics.mean(r["cpu_ms"] for r in rows if r["camera"] == c) for c in scene.cameras}
        total = sum(scene.cameras[c].rate * mean[c] for c in mean) * 1e-3
        return {"scene": scene_name, "renderer": process.renderer, "threads": threads, "rows": rows,
                "startup_s": round(process.startup_s, 2), "all_cpu_s_per_s": round(total, 3)}  # fmt: skip


def main() -> None:
    words = [word for word in sys.argv[1:] if word != "--json"]
    count = int(words[0]) if words else 60
    threads = int(words[1]) if len(words) > 1 else 0
    results = [measure(scene, count, threads) for scene in ("field", "sea")]
    if "--json" in sys.argv:
        print(json.dumps(results, indent=1))
        return
    for result in results:
        print(f"{result['scene']}: {result['renderer']}, ready after {result['startup_s']} s")
        for row in result["rows"]:
            print(f"  {row['camera']:10s} {row['height_m']:5.1f} m   {row['cpu_ms']:6.2f} ms of processor, "
                  f"{row['wall_ms']:6.2f} ms by the clock")  # fmt: skip
        print(f"  all        {result['all_cpu_s_per_s']:.3f} s of processor a second of flight")


if __name__ == "__main__":
    main()
