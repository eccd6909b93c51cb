"""All gains of the pilot, designed at once from the matrices of a hover."""

from dataclasses import dataclass

from controllers.altitude import AltitudeGains, design_altitude
from controllers.attitude import AttitudeGains, design_attitude
from controllers.governor import GovernorGains, design_governor
from controllers.heading import HeadingGains, design_heading
from controllers.plant import LinearPlant
from controllers.position import PositionGains, design_horizontal
from controllers.velocity import VelocityGains
from flightlog.signals import Controls


@dataclass(frozen=True, eq=False)
class Gains:
    """What flies one vehicle: plain numbers, nothing to be designed in flight."""

    attitude: AttitudeGains
    velocity: VelocityGains
    position: PositionGains
    altitude: AltitudeGains
    heading: HeadingGains
    governor: GovernorGains
    trim: Controls
    skid_height: float  # [m] body origin above the skids' plane


def design(plant: LinearPlant) -> Gains:
    """Gains for a vehicle, from its matrices about hover."""
    position, velocity = design_horizontal(plant)
    return Gains(
        attitude=design_attitude(plant),
        velocity=velocity,
        position=position,
        altitude=design_altitude(plant),
        heading=design_heading(plant),
        governor=design_governor(plant),
        trim=plant.trim,
        skid_height=plant.skid_height,
    )
