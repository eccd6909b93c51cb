"""Huang, Li and Fan: the horizon ahead levels the attitude; the rest is Helideck's own."""

from estimators.eyes import Eyes
from estimators.navigator import Navigator as Own
from estimators.navigators.contract import Navigator, Variant
from estimators.vision.front_ends import horizon_eyes, pad_eye
from flightlog.equipment import Equipment
from flightlog.errors import UserError

NEEDS = ("imu", "rotor")


def look(equipment: Equipment, variant: Variant) -> Eyes:
    """The pad below, and the horizon ahead by one camera or, as published, by two.

    Raises:
        UserError: the published form has no second forward camera.
    """
    for camera in ("forward_a", "forward_b"):
        if variant == "published" and camera not in equipment.cameras:
            raise UserError(f'cameras.{camera}: is missing: "huang" as published takes two forward cameras')
    return Eyes(pad=pad_eye(equipment, "helideck"), horizons=horizon_eyes(equipment, variant))


def build(equipment: Equipment, eyes: Eyes, variant: Variant) -> Navigator:
    """Helideck's filters with the horizon among their measurements; `variant` has chosen the eyes."""
    return Own(equipment, eyes, horizon=True)
