"""Which front end looks at what, by the mark on the ground and the variant asked for."""

from typing import Literal

from estimators.eyes import FlowEye, FrontEnd, HorizonEye
from estimators.vision.flow import KeyFrameFlowEye
from estimators.vision.h_mark import HMarkFrontEnd
from estimators.vision.horizon import HorizonFrontEnd
from estimators.vision.huang_horizon import HuangPair
from estimators.vision.integer_flow import IntegerFlowEye
from estimators.vision.lei_mark import LeiFrontEnd
from estimators.vision.ring_mark import RingFrontEnd
from estimators.vision.wu_mark import WuFrontEnd
from flightlog.equipment import Equipment
from flightlog.marks import RingMark

Variant = Literal["helideck", "published"]


def pad_eye(equipment: Equipment, variant: Variant) -> FrontEnd | None:
    """What looks for the mark in the down camera's pictures; None without mark or camera."""
    down, mark = equipment.cameras.get("down"), equipment.mark
    if down is None or mark is None:
        return None
    if isinstance(mark, RingMark):
        if variant == "published":
            return WuFrontEnd(down.model, down.mount, mark, exact=True)
        return RingFrontEnd(down.model, down.mount, mark)
    if variant == "published":
        return LeiFrontEnd(down.model, down.mount, mark)
    # the focal length's error is a state of the altitude filter: no noise of one picture
    return HMarkFrontEnd(down.model, down.mount, mark, scale_std=0.0)


def horizon_eyes(equipment: Equipment, variant: Variant) -> dict[str, HorizonEye]:
    """What looks for the horizon in each forward camera's pictures."""
    ahead = {name: camera for name, camera in equipment.cameras.items() if name.startswith("forward")}
    if variant == "published" and {"forward_a", "forward_b"} <= ahead.keys():
        a, b = ahead["forward_a"], ahead["forward_b"]
        pair = HuangPair((a.model, a.mount), (b.model, b.mount))
        return {"forward_a": pair.eye("a"), "forward_b": pair.eye("b")}
    return {name: HorizonFrontEnd(camera.model, camera.mount) for name, camera in ahead.items()}


def flow_eye(equipment: Equipment, variant: Variant) -> FlowEye | None:
    """What watches the ground move in the down camera's pictures; None without one."""
    down = equipment.cameras.get("down")
    if down is None:
        return None
    return KeyFrameFlowEye(down.model) if variant == "helideck" else IntegerFlowEye(down.model)
