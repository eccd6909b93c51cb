"""Thrust falls with the battery's voltage."""

from identification.causes.contract import Cause, Parameter

SHARE = 1.5  # thrust goes about with this power of the voltage, so that sag is of this size over the voltage itself

CAUSE = Cause(
    name="battery_sag",
    where="plant",
    parameters=(Parameter("sag", "1/V", "terms.battery_sag.sag", 0.4),),
    about="share of thrust lost per volt below the reference",
    needs=("battery",),
    kinds=("multirotor",),
    split_by={
        "mass": "a hover of several minutes: voltage falls, the mass stays",
        "thrust_scale": "a hover of several minutes: voltage falls, the scale stays",
    },
)
