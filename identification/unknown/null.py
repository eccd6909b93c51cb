"""How much evidence an unknown effect must have, by the group of channels that it shows in."""

from collections.abc import Mapping

ALIKE = 3.0  # [nats] within which the data do not tell two drivers, or two channels, apart
MARGIN = 15.0  # [nats] where nothing else is known

# [nats] helicopters
HELICOPTER: Mapping[str, float] = {
    "force": MARGIN, "moment": MARGIN, "rotor": MARGIN, "imu": MARGIN, "gps": MARGIN, "gps.v": MARGIN,
    "baro": MARGIN, "sonar": MARGIN, "mag": MARGIN, "pad": MARGIN,
}  # fmt: skip
