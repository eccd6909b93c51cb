"""Errors of the rendered flow in flight: what the error model of sim/sensors/flow_camera.py is fitted to.

helideck land gps_denied_hover -o hover && python -m benchmarks.flow_camera hover
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import RotationSpline

from flightlog.readers.folder import read_flight
from flightlog.rotations import from_angles
from sim import vehicle

Floats = NDArray[np.float64]
BELOW = 0.001  # [m] the ground that is seen lies below the pad's plane
LAGS = (1, 2, 3, 5, 8, 12, 25)  # pictures


def errors(folder: Path, name: str = "raptor90") -> tuple[Floats, Floats]:
    """Errors (N, 2) [px] of u and v against the truth, and the times of their key frames (N,) [s]."""
    flight = read_flight(folder)
    flow, state = flight.measured["flow"], flight.truth["state"]
    camera = vehicle.load(name).cameras["down"]
    t = state["t"]
    place = CubicSpline(t, np.column_stack([state[c] for c in ("e", "n", "u")]))
    turn = RotationSpline(t, from_angles(state["roll"], state["pitch"], state["heading"]))
    key = flow["t"] - flow["dt"]
    used = (key > t[0]) & (flow["t"] < t[-1]) & (flow["quality"] > 0.0)

    def pose(when: Floats) -> tuple[Floats, Floats]:
        body = turn(when).as_matrix()
        return place(when) + body @ camera.mount.position, body @ camera.mount.axes

    eye, axes = pose(key[used])
    ground = eye - axes[:, :, 2] * ((eye[:, 2] + BELOW) / axes[:, 2, 2])[:, None]
    eye, axes = pose(flow["t"][used])
    seen = np.einsum("nji,nj->ni", axes, ground - eye)
    measured = np.column_stack([flow["u"], flow["v"]])[used]
    missed = (measured - seen[:, :2] / seen[:, 2:]) * [camera.model.fx, camera.model.fy]
    return np.asarray(missed), np.round(key[used], 4)


def main() -> None:
    """Print what is white, what is slow, and what stays with a key frame."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("flights", nargs="+", type=Path)
    for folder in parser.parse_args().flights:
        missed, keys = errors(folder)
        means = np.array([missed[keys == key].mean(axis=0) for key in np.unique(keys)])
        centred = missed - means[np.searchsorted(np.unique(keys), keys)]
        print(f"{folder}: {len(missed)} pictures, {len(means)} key frames")
        print(f"  of a key frame   {np.sqrt(np.mean(means**2)):.4f} px")
        print(f"  about it         {centred.std():.4f} px")
        for lag in LAGS:
            alike = float(np.mean(centred[lag:] * centred[:-lag]) / np.mean(centred**2))
            print(f"  alike {lag:2d} pictures later {alike:+.3f}")


if __name__ == "__main__":
    main()
