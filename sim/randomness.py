"""One seed a flight, one named child a consumer: adding a consumer leaves every other one's draws alone."""

import numpy as np


def generator(flight: np.random.SeedSequence, name: str) -> np.random.Generator:
    """The generator of the consumer `name` in this flight."""
    child = np.random.SeedSequence(entropy=flight.entropy, spawn_key=(*flight.spawn_key, *name.encode()))
    return np.random.Generator(np.random.SFC64(child))
