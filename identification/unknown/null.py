"""How much evidence an unknown effect must have, by the group of channels that it shows in.

A bank of hundreds of curves finds whatever the filters and the model do not get quite right on any flight. Each group's
threshold belongs above the largest log evidence in it on flights on which nothing was wrong (benchmarks/unknown.py).
"""

from collections.abc import Mapping

ALIKE = 3.0  # [nats] within which the data do not tell two drivers, or two channels, apart
MARGIN = 15.0  # [nats] where no nulls were counted

# [nats] helicopters, by hand: above what nulls of two 45 s flights reached before turn and scale of the inertial sensor
# were states of the filter of the motion (one went to 228 in force, 175 in moment, 163 in imu, 152 in pad). Since then
# blind sets stay far below (pad and imu at 4 where they had reached 370); a sound barometer went to 16 near the
# ground, a receiver on its arm to 19
HELICOPTER: Mapping[str, float] = {
    "force": 110.0, "moment": 110.0, "imu": 110.0, "pad": 60.0, "rotor": 60.0, "sonar": 30.0, "gps": 30.0,
    "gps.v": 30.0, "baro": 30.0, "mag": 20.0,
}  # fmt: skip

# [nats] multirotors: of 28 null sets (three flights of 60 s, tests/blind) 27 came to 3.6 at most, one to 18 (yaw moment
# over voltage, which nothing explains yet)
MULTIROTOR: Mapping[str, float] = {"force": 8.0, "moment": 8.0}
