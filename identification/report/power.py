"""What these flights can show: of every cause, how strongly, and how small it may be and still be seen.

d' of a cause of its usual size is the distance of the two hypotheses in standard deviations, everything that may be off
anyway taken out; a test at the threshold of T nats has even odds at d' = sqrt(2 T).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.diagnosis import Diagnosis
from identification.null import HOPELESS


@dataclass(frozen=True)
class Power:
    """One parameter of a cause."""

    cause: str
    parameter: str
    unit: str
    usual: float  # size that a cause of this kind has
    strength: float  # d' at that size
    smallest: float  # size that is detected as often as not; inf: none

    @property
    def seen(self) -> bool:
        """Whether a cause of the usual size would show."""
        return self.strength >= HOPELESS


def power(diagnosis: Diagnosis) -> Sequence[Power]:
    """Of every parameter of every testable cause, strongest first, about the best null."""
    bench, search = diagnosis.bench, diagnosis.search
    stack = search.null.stack
    free = [key for key in stack.keys if bench.tolerances.get(key, 0.0) > 0.0]
    std = np.array([bench.tolerances[key] for key in free])
    index = stack.index(free)
    needed = math.sqrt(2.0 * search.threshold)
    found = []
    for cause in bench.causes:
        for p in cause.parameters:
            if p.key not in stack.keys:
                continue
            others = [i for i, key in enumerate(free) if key != p.key]
            at, own = stack.index([p.key])[0], [index[i] for i in others]
            cross = stack.information[own, at] * std[others]
            inner = std[others, None] * stack.information[np.ix_(own, own)] * std[others]
            left = stack.information[at, at] - cross @ np.linalg.solve(np.eye(len(own)) + inner, cross)
            root = math.sqrt(max(float(left), 0.0))
            usual = bench.spreads[p.key]
            smallest = needed / root if root > 0.0 else math.inf
            # what may be without any cause has to be exceeded
            smallest = math.hypot(smallest, needed * bench.tolerances.get(p.key, 0.0))
            found.append(Power(cause.name, p.name, p.unit, usual, root * usual, smallest))
    return sorted(found, key=lambda item: -item.strength)
