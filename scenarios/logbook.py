"""Writes down what happens aboard and, apart from it, what only a simulator knows."""

from collections.abc import Callable, Sequence
from typing import Any

from flightlog.recorder import Recorder
from flightlog.rotations import angles
from flightlog.signals import (
    BaroSample,
    Controls,
    FlowSample,
    Frame,
    GpsSample,
    HorizonSample,
    ImuSample,
    MagSample,
    Measurement,
    PadSample,
    RotorSample,
    SonarSample,
    StateEstimate,
)
from flightlog.topics import Column, estimate_row
from sim.world import STEP, World

TOPICS = {
    ImuSample: "imu",
    MagSample: "mag",
    BaroSample: "baro",
    GpsSample: "gps",
    SonarSample: "sonar",
    RotorSample: "rotor",
    PadSample: "pad",
    HorizonSample: "horizon",
    FlowSample: "flow",
}
FLUSH_EVERY = 1.0  # [s] a killed flight is readable up to here
ESTIMATE_EVERY = 2  # steps: 125 Hz
ERRORS_EVERY = 25  # steps: 10 Hz

Append = Callable[[Sequence[Any]], None]


class Logbook:
    """The recorder's topics, filled step by step."""

    def __init__(self, recorder: Recorder, world: World, *, frames: bool) -> None:
        """frames: keep the pictures as files too."""
        self._recorder = recorder
        self._frames = frames
        self._append: dict[type, Append] = {
            kind: recorder.topic("measured", topic).append for kind, topic in TOPICS.items()
        }
        self._controls = recorder.topic("measured", "controls").append
        self._estimate = recorder.topic("measured", "estimate").append
        self._state = recorder.topic("truth", "state").append
        self._wind = recorder.topic("truth", "wind").append
        self._rotor = recorder.topic("truth", "rotor").append
        self._contact = recorder.topic("truth", "contact").append
        columns = [Column("t", "s")]
        columns += [
            Column(f"{topic}_{name}", unit) for topic, states in world.error_columns().items() for name, unit in states
        ]
        self._errors = recorder.topic("truth", "errors", columns).append
        self._steps = 0
        self._next_flush = FLUSH_EVERY

    def write(
        self,
        world: World,
        measurements: Sequence[Measurement],
        detections: Sequence[Measurement],
        state: StateEstimate,
        controls: Controls,
    ) -> None:
        """One step of the loop; `controls` are those that the step has flown with."""
        for sample in measurements:
            kind = type(sample)
            if kind is Frame:
                if self._frames:
                    self._recorder.frame(sample)  # type: ignore[arg-type]
            else:
                self._append[kind](sample)  # type: ignore[arg-type]
        for sample in detections:
            if not any(sample is known for known in measurements):  # a navigator may report what it was given
                self._append[type(sample)](sample)  # type: ignore[arg-type]
        t = world.t
        self._controls((t - STEP, *controls))
        if self._steps % ESTIMATE_EVERY == 0:
            truth = world.truth
            self._estimate(estimate_row(state))
            self._state(
                (
                    truth.t,
                    *truth.position.tolist(),
                    *truth.velocity.tolist(),
                    *angles(truth.quaternion),
                    *truth.rates.tolist(),
                )
            )
            self._wind((truth.t, *truth.wind.tolist()))
            self._rotor((truth.t, truth.rotor_speed))
            self._contact((t, world.contact.count, world.contact.force))
        if self._steps % ERRORS_EVERY == 0:
            self._errors((t, *(value for states in world.sensor_errors().values() for value in states)))
        self._steps += 1
        if t >= self._next_flush:
            self._recorder.flush()
            self._next_flush = t + FLUSH_EVERY
