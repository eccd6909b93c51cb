"""The horizon in the loop: both variants see it in rendered pictures and level by it."""

import math

import pytest

from scenarios.flight import fly
from scenarios.load import load


@pytest.mark.parametrize("variant", ["helideck", "published"])
def test_the_attitude_is_levelled_by_what_the_cameras_see(variant: str) -> None:
    stds, seen, rejected = [], [], {}

    def watch(world, measurements, navigator, state) -> None:
        stds.append(math.degrees(float(state.std_attitude[0])))
        seen.extend(item for item in navigator.detections if hasattr(item, "std_roll"))
        rejected.update(navigator.rejected)

    fly(load("horizon_hold", {"variant": variant, "duration_s": 2.5}), seed=1, onlooker=watch)
    assert len(seen) >= 20  # ten a second, less their latency: one an instant, whichever camera saw it
    assert len({item.t for item in seen}) == len(seen)
    assert all(abs(item.roll) < 0.15 and abs(item.pitch) < 0.15 for item in seen)
    assert rejected.get("horizon", 0) == 0
    # by inertial sensors and GPS alone it is 0.37 deg
    assert stds[-1] < (0.12 if variant == "helideck" else 0.3)
