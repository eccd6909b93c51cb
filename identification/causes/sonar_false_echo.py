"""The ranger claims echoes from where nothing is."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="sonar_false_echo",
    where="sensor",
    parameters=(
        Parameter("share", "1", "sensors.sonar.false_echo_share", 0.3, tolerance="sensors.sonar.false_echo_share"),
    ),
    about="share of the samples out of reach that show an echo, beyond the declared",
    needs=("sonar",),
    kinds=("helicopter", "multirotor"),
    counted=True,
)
