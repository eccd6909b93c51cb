"""Play between command and servo: the control moves only once the command has taken up the slack.

    |command - held| <= width / 2: held stays; else it follows at that distance
"""

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _deadband(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    command = (s.collective, s.lateral, s.longitudinal, s.tail)
    half = 0.5 * p[0]
    if x[4] == 0.0:
        for i in range(4):
            x[i] = command[i]
        x[4] = 1.0
    for i in range(4):
        x[i] = min(max(x[i], command[i] - half), command[i] + half)
    s.collective, s.lateral, s.longitudinal, s.tail = x[0], x[1], x[2], x[3]


TERM = Term(
    name="deadband",
    stage=Stage.COMMAND,
    kernel=_deadband,
    parameters=(Parameter("width", "rad", 0.0, 0.2, "slack of each control, from one side to the other"),),
    states=("collective", "lateral", "longitudinal", "tail", "begun"),
    source="backlash without friction",
)
