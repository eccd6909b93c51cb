"""Servos: every control reaches the swash plate late, slowly, at a limited rate and within its stops.

Pure delay, the stops, then a lag whose slope is limited: of first order, or, where a `second` stage in series (a
linkage, an amplifier) has a share of the time constant, of second order:

    1 / ((1 + (1 - k) tau s) (1 + k tau s)),    0 <= k <= 1/2

tau is the time by which a ramp is late, whatever the share. The command is held between ticks, so the linear
interpolation in the ring is exactly the mean, over one tick, of the delayed command.
"""

import math

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel

CONTROLS = ("collective", "lateral", "longitudinal", "tail", "throttle")
LONGEST_DELAY = 0.1  # [s]
SLOTS = 52  # of the ring: 0.1 s at 2 ms, one to interpolate with, one to write
_SPACING = LONGEST_DELAY / 50  # [s] least time between two entries
_HEAD, _AGE, _FILLED, _STAGE, _RING = 5, 6, 7, 8, 12  # after the five positions


@kernel
def _servo(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    # x: positions (5), newest slot, its age [s], 1 once filled, second stages (4), the ring (SLOTS, 5)
    command = (s.collective, s.lateral, s.longitudinal, s.tail, s.throttle)
    low = (p[4], -p[6], -p[6], -p[7], 0.0)
    high = (p[5], p[6], p[6], p[7], 1.0)
    if x[_FILLED] == 0.0:  # servos stand where the first command puts them
        for i in range(5):
            x[i] = min(max(command[i], low[i]), high[i])
            if i < 4:
                x[_STAGE + i] = x[i]
            for slot in range(SLOTS):
                x[_RING + 5 * slot + i] = command[i]
        x[_FILLED] = 1.0
        x[_AGE] = dt
    # entries lie a whole number of ticks apart, at least _SPACING, so that any tick covers the longest delay
    spacing = dt * max(1.0, math.ceil(_SPACING / dt - 1e-9))
    x[_AGE] += dt
    head = int(x[_HEAD])
    if x[_AGE] >= spacing - 1e-9 * spacing:
        head = (head + 1) % SLOTS
        for i in range(5):
            x[_RING + 5 * head + i] = command[i]
        x[_HEAD] = head
        x[_AGE] = 0.0

    first, second, slow = (1.0 - p[9]) * p[1], p[9] * p[1], p[3]
    share_first = 1.0 - math.exp(-dt / first) if first > 0.0 else 1.0
    share_second = 1.0 - math.exp(-dt / second) if second > 0.0 else 1.0
    share_slow = 1.0 - math.exp(-dt / slow) if slow > 0.0 else 1.0
    for i in range(5):
        delay = p[0] if i < 4 else p[8]
        if delay <= x[_AGE]:  # between the command of this tick and the newest entry
            share = delay / x[_AGE] if x[_AGE] > 0.0 else 0.0
            late = command[i] + share * (x[_RING + 5 * head + i] - command[i])
        else:
            back = (delay - x[_AGE]) / spacing
            whole = min(int(back), SLOTS - 2)
            share = min(back - whole, 1.0)
            near = x[_RING + 5 * ((head - whole) % SLOTS) + i]
            far = x[_RING + 5 * ((head - whole - 1) % SLOTS) + i]
            late = near + share * (far - near)
        late = min(max(late, low[i]), high[i])
        if i < 4:
            x[_STAGE + i] += share_second * (late - x[_STAGE + i])
            step = share_first * (x[_STAGE + i] - x[i])
            x[i] += min(max(step, -p[2] * dt), p[2] * dt)
        else:
            x[i] += share_slow * (late - x[i])
    s.collective, s.lateral, s.longitudinal, s.tail, s.throttle = x[0], x[1], x[2], x[3], x[4]


TERM = Term(
    name="servo",
    stage=Stage.SERVO,
    kernel=_servo,
    parameters=(
        Parameter("delay", "s", 0.0, LONGEST_DELAY, "pure delay from the command to the servo's first motion"),
        Parameter("tau", "s", 0.0, 0.5, "time constant of the lag"),
        Parameter("rate_limit", "rad/s", 0.05, 100.0, "fastest change of the control at the blade"),
        Parameter("throttle_tau", "s", 0.0, 1.0, "time constant of the throttle's lag"),
        Parameter("collective_min", "rad", -0.5, 0.2, "lowest collective"),
        Parameter("collective_max", "rad", 0.0, 0.5, "highest collective"),
        Parameter("cyclic_max", "rad", 0.01, 0.5, "largest cyclic, either way"),
        Parameter("tail_max", "rad", 0.01, 1.0, "largest tail pitch about its trim, either way"),
        Parameter("throttle_delay", "s", 0.0, LONGEST_DELAY, "pure delay of the throttle", 0.0),
        Parameter("second", "1", 0.0, 0.5, "share of the lag that a second stage in series has", 0.0),
    ),
    states=(
        *CONTROLS, "head", "age", "filled", *(f"stage_{name}" for name in CONTROLS[:4]),
        *(f"{name}_{slot}" for slot in range(SLOTS) for name in CONTROLS),
    ),
    source="linear lag of first or second order with slope and position limits; delay of a held command",
)
