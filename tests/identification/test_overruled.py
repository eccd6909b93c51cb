"""Errors of sensors that the model asks for and the sensors themselves speak against."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
import pytest

from flightlog.errors import UserError
from identification.bench import Baseline
from identification.causes.contract import Cause, Change, Parameter
from identification.overruled import overruled
from identification.search import Search
from identification.stack import Rows
from sim import vehicle

SCALE = "sensors.imu.scale_wz"
GYRO = Cause(
    "gyro", "sensor", (Parameter("wz", "1", SCALE, 1.0),), "a gyro reads too much", changes=lambda f, v: [Change()]
)
SENSORS, MODEL = 0, 100


class TwoWitnesses:
    """One number shifts what the other sensors say and what the model says; each has its own view of it."""

    def __init__(self, seen: float, asked: float) -> None:
        self.vehicle = vehicle.load("raptor90")
        self.names, self.causes = ["flight"], [GYRO]
        self.not_testable: Mapping[str, Sequence[str]] = {}
        self.channels: Mapping[int, object] = {}
        self.sensor_channels = [SENSORS]
        self.nominal, self.tolerances, self.spreads = {SCALE: 0.0}, {SCALE: 0.01}, {SCALE: 1.0}
        self.units = {SCALE: "1"}
        self.baseline = Baseline(True, None)
        noise = np.random.default_rng(2).standard_normal(400)
        self.channel = np.repeat([SENSORS, MODEL], [100, 300])
        self.measured = noise + np.where(self.channel == SENSORS, seen, asked)

    def rows(self, flight: int, changes: Mapping[str, float], fresh: Collection[str] = ()) -> Rows:
        size, one = dict(changes).get(SCALE, 0.0), np.ones(400)
        nothing = np.zeros((400, 1))
        return Rows(self.measured - size, {SCALE: one}, nothing, np.ones(1), self.channel, np.arange(400.0))

    def bounded(self, key: str, value: float) -> float:
        if key != SCALE:
            raise UserError(f"{key}: not a number of this bench")
        return value


@pytest.mark.parametrize(("seen", "found"), [(1.0, ("gyro",)), (0.25, ("gyro",)), (0.1, ()), (0.0, ())])
def test_an_error_of_a_sensor_needs_that_the_others_do_not_deny_it(seen: float, found: tuple[str, ...]) -> None:
    search = Search(TwoWitnesses(seen, 1.0), 15.0)
    assert search.run() == found
    assert search.gain(("gyro",)) > 15.0  # the likelihood as a whole would have it either way


def test_a_cause_of_the_plant_is_not_asked_for_by_sensors() -> None:
    bench = TwoWitnesses(0.0, 1.0)
    search = Search(bench, 15.0)
    plant = Cause("drag", "plant", GYRO.parameters, "the model lacks drag")
    assert overruled(bench, GYRO, search.fit(()), search.fit(("gyro",)))
    assert not overruled(bench, plant, search.fit(()), search.fit(("gyro",)))
