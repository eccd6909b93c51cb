"""The landing as a dm_env environment, so that a learner can fly it.

Observations are what the navigator believes; the truth decides the reward alone. One step is one turn of the loop,
4 ms, or as many as asked for. `make()` gives a `dm_control.rl.control.Environment`.
"""

import math
from collections import OrderedDict
from typing import Any

import numpy as np
from dm_control.rl import control
from dm_env import specs
from numpy.typing import NDArray

from estimators.navigators import Navigator
from flightlog.signals import Controls, StateEstimate
from scenarios.crew import make_navigator
from scenarios.load import load
from scenarios.schema import Scenario
from scenarios.staging import make_equipment, make_world
from sim import vehicle as vehicles
from sim.divergence import SimulationDiverged
from sim.world import STEP, World

Floats = NDArray[np.float64]

GONE = 30.0  # [m] from the pad: the episode ends
SOFT = 0.5  # [m/s] sink below which a touchdown is one


class LandingPhysics(control.Physics):  # type: ignore[misc]
    """World and navigator behind dm_control's interface."""

    def __init__(self, scenario: Scenario, *, cameras: bool) -> None:
        self.scenario = scenario
        self.vehicle = vehicles.load(scenario.vehicle)
        self._cameras = cameras
        self._seeds = np.random.SeedSequence(0)
        self.world: World | None = None
        self.navigator: Navigator | None = None
        self.state: StateEstimate | None = None
        self.controls = Controls()
        self.diverged = False

    def begin(self, seeds: np.random.SeedSequence) -> None:
        """Take the seeds of the episode that the next reset starts."""
        self._seeds = seeds

    def reset(self) -> None:
        """A new world, before its first step."""
        self.free()
        self.world = make_world(self.scenario, self._seeds, self.vehicle, cameras=self._cameras)
        equipment = make_equipment(self.scenario, self.vehicle, self.world)
        self.navigator = make_navigator(equipment, self.scenario, self._cameras)
        self.controls = self.world.trim.controls
        self.diverged = False

    def after_reset(self) -> None:
        """Fly one step at trim: the navigator then has something to say."""
        self.step()

    def step(self, n_sub_steps: int = 1) -> None:
        """Turn the loop that many times with the controls as set."""
        assert self.world is not None and self.navigator is not None
        for _ in range(n_sub_steps):
            try:
                self.world.step(self.controls)
            except SimulationDiverged:
                self.diverged = True
                return
            self.state = self.navigator.update(self.world.measure())

    def set_control(self, control: Floats) -> None:
        """collective, lateral, longitudinal, tail [rad], throttle [0..1]."""
        self.controls = Controls(*np.asarray(control, float).tolist())

    def time(self) -> float:
        """Time [s]."""
        return self.world.t if self.world is not None else 0.0

    def timestep(self) -> float:
        """One turn of the loop [s]."""
        return STEP

    def check_divergence(self) -> None:
        """The world does that itself, and the task ends the episode."""

    def free(self) -> None:
        """Let go of the cameras."""
        if self.world is not None:
            self.world.close()
            self.world = None


class LandingTask(control.Task):  # type: ignore[misc]
    """Come down on the mark, softly and upright."""

    def __init__(self, random: np.random.SeedSequence) -> None:
        """`random`: one child an episode."""
        self._random = random

    def initialize_episode(self, physics: LandingPhysics) -> None:
        """Nothing beyond the reset; `Environment.reset` has taken the seeds."""

    def seeds(self) -> np.random.SeedSequence:
        """The seeds of the next episode."""
        return self._random.spawn(1)[0]

    def action_spec(self, physics: LandingPhysics) -> specs.BoundedArray:
        """The controls within the servos' stops."""
        servo = physics.vehicle.parameters["servo"]
        cyclic, tail = servo["cyclic_max"], servo["tail_max"]
        low = [servo["collective_min"], -cyclic, -cyclic, -tail, 0.0]
        high = [servo["collective_max"], cyclic, cyclic, tail, 1.0]
        return specs.BoundedArray((5,), np.float64, low, high, name=",".join(Controls._fields))

    def before_step(self, action: Floats, physics: LandingPhysics) -> None:
        """Hand the action over as controls."""
        physics.set_control(action)

    def after_step(self, physics: LandingPhysics) -> None:
        """Nothing."""

    def get_observation(self, physics: LandingPhysics) -> "OrderedDict[str, Floats]":
        """The navigator's state and how sure it is; [m], [m/s], [rad], [rad/s], ENU and body axes."""
        state = physics.state
        assert state is not None
        return OrderedDict(
            position=state.position.copy(),
            velocity=state.velocity.copy(),
            angles=np.array([state.roll, state.pitch, math.sin(state.heading), math.cos(state.heading)]),
            rates=state.rates.copy(),
            rotor_speed=np.array([state.rotor_speed]),
            std_position=state.std_position.copy(),
            std_velocity=state.std_velocity.copy(),
            pad_age=np.array([min(state.pad_age, 1e3)]),
        )

    def get_reward(self, physics: LandingPhysics) -> float:
        """Near the mark and slow, each step; at contact, 10 for a soft touchdown within 0.3 m, less with distance."""
        assert physics.world is not None
        truth = physics.world.truth
        distance = float(np.linalg.norm(truth.position - [0.0, 0.0, physics.world.site.skid_height]))
        if physics.diverged:
            return -10.0
        reward = -STEP * (0.1 * distance + 0.1 * float(np.linalg.norm(truth.velocity)))
        if physics.world.contact.count:
            offset = math.hypot(truth.position[0], truth.position[1])
            soft = -truth.velocity[2] < SOFT and truth.rotation[2, 2] > 0.97
            reward += 10.0 * math.exp(-0.5 * (offset / 0.3) ** 2) if soft else -10.0
        return reward

    def get_termination(self, physics: LandingPhysics) -> float | None:
        """Ends with contact, far from the pad, or where the physics leaves the numbers; discount 0."""
        assert physics.world is not None
        gone = float(np.linalg.norm(physics.world.truth.position)) > GONE
        return 0.0 if physics.diverged or physics.world.contact.count or gone else None


class LandingEnvironment(control.Environment):  # type: ignore[misc]
    """dm_control's environment, with a new seed for every episode."""

    def reset(self) -> Any:
        """The first time step of a new episode."""
        self._physics.begin(self._task.seeds())
        return super().reset()

    def close(self) -> None:
        """Let go of the cameras."""
        self._physics.free()
        super().close()


def make(
    scenario: Scenario | str = "landing", *, seed: int = 0, cameras: bool = False, steps: int = 5
) -> LandingEnvironment:
    """The landing of a scenario; `steps` turns of the loop to one of the environment's (5: 50 Hz)."""
    loaded = load(scenario) if isinstance(scenario, str) else scenario
    return LandingEnvironment(
        LandingPhysics(loaded, cameras=cameras),
        LandingTask(np.random.SeedSequence(seed)),
        time_limit=loaded.duration_s,
        n_sub_steps=steps,
    )
