"""Wu et al. 2019: position by the ring and T landmark, filtered with the acceleration."""

from estimators.eyes import Eyes
from estimators.navigator import Navigator as Own
from estimators.navigators.contract import Navigator, Variant
from estimators.vision.front_ends import horizon_eyes, pad_eye
from estimators.wu_navigator import WuNavigator
from flightlog.equipment import Equipment
from flightlog.errors import UserError
from flightlog.marks import HMark

NEEDS = ("imu", "rotor")


def look(equipment: Equipment, variant: Variant) -> Eyes:
    """The landmark below; the horizon ahead is drawn only.

    Raises:
        UserError: the published front end knows the ring landmark alone.
    """
    if variant == "published" and isinstance(equipment.mark, HMark):
        raise UserError('pad: the navigator "wu2019" as published reads the ring landmark alone; pad = "ring" would do')
    return Eyes(pad=pad_eye(equipment, variant), horizons=horizon_eyes(equipment, variant))


def build(equipment: Equipment, eyes: Eyes, variant: Variant) -> Navigator:
    """As published, the paper's filter; else Helideck's navigator with its front end for the ring.

    The attitude is used, which the paper takes for level: level, its own figures are out of reach (docs/papers.md).
    """
    return Own(equipment, eyes) if variant == "helideck" else WuNavigator(equipment, eyes, exact=True)
