"""How much evidence an unknown effect must have, by the group of channels that it shows in.

A bank of hundreds of curves finds whatever the filters and the model do not get quite right on any flight. Each group's
threshold belongs above the largest log evidence in it on flights on which nothing was wrong (benchmarks/unknown.py).
"""

from collections.abc import Mapping

ALIKE = 3.0  # [nats] within which the data do not tell two drivers, or two channels, apart
MARGIN = 15.0  # [nats] where no nulls were counted

# [nats] helicopters: of 40 null sets (three flights of 60 s, tests/blind) force came to 38 at most, moment 41, mag 22,
# gps.v 10, imu 6, gps 4, rotor and pad 1, a sonar in reach of the ground in two only, 3; baro 25 before what the rotor
# adds went through its lag. A Gumbel tail of these (benchmarks/unknown.py) puts one set in 500 at force 57, moment 81,
# baro 39, mag 35, and the others at 15 or less. The receiver's stands by hand: where its wander is quicker than in the
# file, its innovations remember for seconds, and a curve of height took 69 on a set with late servos. So do those of
# moments and of the side force: a tail rotor in wind of 6 m/s from aside has a kink, which its gusts' slopes have not;
# curves of the yaw rate and of time took up to 109 on sets with other causes, of the tail's pitch 137. And those of
# force and of the inertial sensor: 60 and 32 there; and the barometer's, of which one of 40 later null sets made 41
HELICOPTER: Mapping[str, float] = {
    "force": 80.0, "force_y": 160.0, "moment": 150.0, "imu": 40.0, "pad": 20.0, "rotor": 20.0, "sonar": 20.0,
    "gps": 80.0, "gps.v": 20.0, "baro": 60.0, "mag": 40.0,
}  # fmt: skip

# [nats] multirotors: of 28 null sets (three flights of 60 s, tests/blind) 27 came to 3.6 at most, one to 18 (yaw moment
# over voltage, which nothing explains yet)
MULTIROTOR: Mapping[str, float] = {"force": 8.0, "moment": 8.0}
