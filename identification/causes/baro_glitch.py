"""The barometer jumps and comes back."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="baro_glitch",
    where="sensor",
    parameters=(
        Parameter("count", "1", "sensors.baro.glitch_count", 1.0),
        Parameter("size", "m", "sensors.baro.glitch_size", 10.0),
        Parameter("first", "s", "sensors.baro.glitch_first", 100.0),
    ),
    about="jumps that no aircraft and no other height makes",
    needs=("baro",),
    kinds=("helicopter", "multirotor"),
    counted=True,
)
