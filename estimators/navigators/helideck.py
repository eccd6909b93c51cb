"""Helideck's own: everything aboard in one state, delays replayed exactly."""

from estimators.eyes import Eyes
from estimators.navigator import Navigator
from estimators.navigators.contract import Variant
from estimators.vision.front_ends import horizon_eyes, pad_eye
from flightlog.equipment import Equipment

NEEDS = ("imu", "rotor")


def look(equipment: Equipment, variant: Variant) -> Eyes:
    """The pad below and the horizon ahead."""
    return Eyes(pad=pad_eye(equipment, variant), horizons=horizon_eyes(equipment, variant))


def build(equipment: Equipment, eyes: Eyes, variant: Variant) -> Navigator:
    """The navigator; `variant` has chosen its eyes already."""
    return Navigator(equipment, eyes)
