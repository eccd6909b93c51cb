"""Slack between command and servo."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="actuator_deadband",
    where="plant",
    parameters=(Parameter("width", "rad", "terms.deadband.width", 0.01),),
    about="play of each control",
)
