"""How much evidence a cause must have before it is asserted, in one place.

Log Bayes factors of the best of all causes over none, on flights whose every parameter is a draw from what the vehicle
file declares, have a tail; the threshold belongs where that tail has fallen to the family-wise rate. It does not stand
there yet: it was chosen by hand, and docs/diagnosis.md says how many such flights still raise an alarm.
"""

THRESHOLD = 10.0  # [nats] for a cause, over the best explanation without it
CLASS_MARGIN = 3.0  # [nats] within which the data do not tell two causes apart
ALIKE = 0.95  # cosine of two signatures, from which on they are one class
UNJUDGED = 1.3  # chi-square over its degrees of freedom, beyond which the best explanation is none
HOPELESS = 3.0  # d' below which a cause cannot be seen on these flights

# [SI] what sound flights show of a cause because filter and model are not exact, one standard deviation: stamps to a
# part of a sample, slopes taken over nodes of 0.04 s. From nulls of the simulator (docs/diagnosis.md).
APPARENT = {
    "sensors.imu.clock": 0.002,
    "sensors.baro.clock": 0.005,
    "sensors.mag.clock": 0.003,
    "sensors.sonar.clock": 0.005,
    "cameras.down.stamp_delay": 0.002,
    "cameras.down.focal_scale": 0.002,
    "sensors.imu.scale_fx": 0.05,
    "sensors.imu.scale_fy": 0.05,
    "sensors.imu.scale_wx": 0.004,
    "sensors.imu.scale_wy": 0.004,
    "sensors.imu.scale_wz": 0.004,
}
