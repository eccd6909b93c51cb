"""Play between command and servo: the control moves only once the command has taken up the slack.

    |command - held| <= width / 2: held stays; else it follows at (1 - release) width / 2

release 0 is backlash: the control stays behind by half the slack. release 1 sticks: it holds, then goes all the way, as
a servo's own dead zone and a linkage that breaks loose do.
"""

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _deadband(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    command = (s.collective, s.lateral, s.longitudinal, s.tail)
    half = 0.5 * p[0]
    behind = (1.0 - p[1]) * half
    if x[4] == 0.0:
        for i in range(4):
            x[i] = command[i]
        x[4] = 1.0
    for i in range(4):
        if command[i] - x[i] > half:
            x[i] = command[i] - behind
        elif x[i] - command[i] > half:
            x[i] = command[i] + behind
    s.collective, s.lateral, s.longitudinal, s.tail = x[0], x[1], x[2], x[3]


TERM = Term(
    name="deadband",
    stage=Stage.COMMAND,
    kernel=_deadband,
    parameters=(
        Parameter("width", "rad", 0.0, 0.2, "slack of each control, from one side to the other"),
        Parameter("release", "1", 0.0, 1.0, "how much of the slack is given up once it moves", 0.0),
    ),
    states=("collective", "lateral", "longitudinal", "tail", "begun"),
    source="backlash without friction; dry friction without inertia",
)
