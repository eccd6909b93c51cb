"""The rotor's speed gives way under load: its governor, or what opens the carburettor, droops.

Proportional droop as in `sim.terms.rotor_droop`. The deficit of thrust follows by the speed that was measured.
"""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="rotor_droop",
    where="plant",
    parameters=(Parameter("droop", "1", "terms.rotor_droop.droop", 0.06),),
    about="share of the rotor's speed lost for a hover's torque, the throttle as it is",
    needs=("rotor",),
    split_by={"thrust_scale": "collective doublets: a droop needs a second to show, a scale none"},
)
