"""The air moves, over all the flights, as it is not expected to: faster, or with another profile over the height.

Each flight's own mean wind is free within `environment.wind_std` of the vehicle file, so that it costs little; the
mean of all flights is named only where that spread does not hold it.
"""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="wind",
    where="plant",
    parameters=(
        Parameter("e", "m/s", "environment.wind_e", 10.0),
        Parameter("n", "m/s", "environment.wind_n", 10.0),
        Parameter("shear", "1", "environment.wind_shear", 0.7, nominal=1.0),
    ),
    about="mean wind at 10 m, where the air moves to; shear: of the logarithmic profile over the height, 0 none",
    split_by={
        "cg_offset": "a full turn in hover: an offset turns with the body, the wind does not",
        "drag": "a box flown at 5 m/s: drag changes sides with the direction of flight",
        "imu_bias": "a full turn in hover: a bias turns with the body, the wind does not",
    },
)
