"""One device's clock is off against all the others.

What it measures at t it stamps t + delay, so that it shows what was so much earlier. A receiver's clock is the same
number as its latency beyond the known one, the down camera's the same as that of its pictures: there the two causes
are one, told under the more special name. The clock of the commands is `actuator_delay`.
"""

from collections.abc import Callable

from identification.causes.contract import Cause, Change, Parameter
from identification.flight import Flight
from identification.views import TOPICS, late, others_early
from sim.vehicle import Vehicle

# stream: where its clock stands in the vehicle file, and the usual size of an offset [s]
CLOCKS = {
    "imu": ("sensors.imu.clock", 0.04),
    "gps": ("sensors.gps.delay", 0.15),
    "baro": ("sensors.baro.clock", 0.3),
    "mag": ("sensors.mag.clock", 0.1),
    "sonar": ("sensors.sonar.clock", 0.1),
    "pad": ("cameras.down.stamp_delay", 0.06),
}
TOLERANCES = {"gps": "sensors.gps.latency", "pad": "cameras.down.latency"}


def _changes(topic: str) -> Callable[[Flight, Vehicle], list[Change]]:
    def changes(flight: Flight, vehicle: Vehicle) -> list[Change]:
        """What was so long ago."""
        return [Change(late(flight, vehicle, topic)) if topic in TOPICS else others_early(flight, vehicle)]

    return changes


def of(topic: str) -> Cause:
    """The cause for one stream."""
    key, spread = CLOCKS[topic]
    return Cause(
        name=f"clock_offset#{topic}",
        where="timing",
        parameters=(Parameter("delay", "s", key, spread, tolerance=TOLERANCES.get(topic)),),
        about=f"time by which the clock of one device is ahead of the others': {topic}",
        needs=(topic,),
        changes=_changes(topic),
        topic=topic,
        alike=len(CLOCKS),
        split_by={
            "actuator_delay": "a turn by hand with the rotor stopped: the clocks of the sensors alone",
            "baro_lag": "climbs and descents that begin and end sharply: a lag rounds them",
        },
    )


ALL = tuple(of(topic) for topic in CLOCKS)
CAUSE = of("imu")
