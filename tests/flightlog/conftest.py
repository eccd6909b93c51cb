"""A small flight whose every number is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec, Equipment, SensorSpec
from flightlog.marks import HMark
from flightlog.recorder import Recorder, write_flight
from flightlog.rotations import matrix, quaternion


def position(t):
    """A slow descent over the pad, drifting north-east: (..., 3) [m] ENU."""
    t = np.asarray(t, float)
    return np.stack([0.05 * t, 0.1 * np.sin(t), 10.0 - 0.8 * t], axis=-1)


def attitude(t):
    """Roll, pitch, heading [rad], well away from level."""
    return 0.1 * np.sin(t), 0.15 * np.cos(t), 0.5 + 0.02 * t


@pytest.fixture(scope="session")
def equipment():
    cameras = {
        "down": CameraSpec(
            25.0, 0.06, CameraModel.centred(160, 120, 200.0, 170.0), CameraMount.downward((0.1, 0, -0.1))
        ),
        "forward_a": CameraSpec(10.0, 0.06, CameraModel.centred(120, 90, 100.0), CameraMount.forward((0.4, 0, 0))),
    }
    places = {"imu": (0, 0, 0), "baro": (0, 0, 0), "gps": (-0.5, 0.1, 0.3), "sonar": (0.2, 0.0, -0.05)}
    return Equipment(
        sensors={name: SensorSpec(25.0, 0.0, np.array(place, float), {}) for name, place in places.items()},
        cameras=cameras,
        mark=HMark(),
        skid_height=0.23,
        nominal_rotor_speed=157.0,
        surface_pressure=101325.0,
        surface_temperature=288.15,
        magnetic_field=np.array([0.0, 20.0, -44.0]),
    )


@pytest.fixture(scope="session")
def logged(tmp_path_factory, equipment):
    """A folder of 12 s of flight with sensors that make no errors, but late and away from the body's origin."""
    folder = tmp_path_factory.mktemp("log") / "flight"
    down = equipment.cameras["down"].mount
    with Recorder(folder) as recorder:
        write_flight(folder, {"scenario": "test"})
        for k in range(12 * 100):
            t = k / 100
            here, angles = position(t), attitude(t)
            turn = matrix(quaternion(*map(float, angles)))
            recorder.topic("truth", "state").append((t, *here, 0.05, 0.1 * np.cos(t), -0.8, *angles, 0, 0, 0))
            if k % 2 == 0:
                recorder.topic("measured", "estimate").append(
                    (t, *(here + [0.1, 0, 0.05]), 0.05, 0.1, -0.8, *angles, *[0.0] * 12)
                )
                recorder.topic("measured", "controls").append((t, 0.1, 0.01, -0.01, 0.02, 0.6))
                recorder.topic("measured", "rotor").append((t, 157.0))
            if k % 4 == 0:
                recorder.topic("measured", "baro").append((t, 1e5, 288.0, here[2] + 0.5))
                seen = down.axes.T @ (turn.T @ -here - down.position)
                recorder.topic("measured", "pad").append((t, t + 0.05, *seen, 0.0, *[0.01] * 4, 0.9, "tracked"))
                beam = turn[2] @ equipment.sensors["sonar"].position
                echo = (here[2] + beam) / turn[2, 2]
                recorder.topic("measured", "sonar").append((t, echo if echo < 3.05 else 3.05, bool(echo < 3.05)))
            if k % 20 == 0:
                antenna = here + turn @ equipment.sensors["gps"].position
                recorder.topic("measured", "gps").append((t, t + 0.2, *antenna, 0, 0, 0, 9, 0.9, k > 100))
    return SimpleNamespace(folder=folder, position=position, attitude=attitude)
