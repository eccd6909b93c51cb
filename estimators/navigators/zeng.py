"""Zeng and Jiang: optical flow and inertial sensors; position counts from where the flight begins."""

from estimators.eyes import Eyes
from estimators.navigator import Navigator as Own
from estimators.navigators.contract import Navigator, Variant
from estimators.vision.front_ends import flow_eye
from estimators.zeng_navigator import ZengNavigator
from flightlog.equipment import Equipment

NEEDS = ("imu", "rotor")


def look(equipment: Equipment, variant: Variant) -> Eyes:
    """The ground below, and nothing else."""
    return Eyes(flow=flow_eye(equipment, variant))


def build(equipment: Equipment, eyes: Eyes, variant: Variant) -> Navigator:
    """Complementary filters as published, or Helideck's filters with the key frame's place among their states."""
    return Own(equipment, eyes, flow=True) if variant == "helideck" else ZengNavigator(equipment, eyes)
