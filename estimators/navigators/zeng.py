"""Zeng and Jiang: optical flow and inertial sensors; position counts from where the flight begins."""

from estimators.eyes import Eyes
from estimators.navigator import Navigator
from estimators.navigators.contract import Variant
from estimators.vision.front_ends import flow_eye
from flightlog.equipment import Equipment

NEEDS = ("imu", "rotor")


def look(equipment: Equipment, variant: Variant) -> Eyes:
    """The ground below, and nothing else."""
    return Eyes(flow=flow_eye(equipment, variant))


def build(equipment: Equipment, eyes: Eyes, variant: Variant) -> Navigator:
    """Helideck's filters with flow."""
    return Navigator(equipment, eyes, flow=True)
