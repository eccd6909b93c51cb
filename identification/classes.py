"""What the data cannot tell apart."""

import numpy as np

from identification.null import ALIKE, CLASS_MARGIN
from identification.search import Names, Search


def rivals(search: Search, best: Names, name: str) -> dict[str, float]:
    """Log evidence of each cause put in the place of `name` in the set `best`, itself among them.

    Refitted where it was tried, linear elsewhere.
    """
    rest = tuple(n for n in best if n != name)
    base = search.gain(rest)
    found = {score.causes[0]: base + score.log_evidence for score in search.screen(rest)}
    for other in found:
        whole = tuple(sorted((*rest, other)))
        if whole in search.refits:
            found[other] = search.gain(whole)
    return found


def confusable(search: Search, best: Names, name: str) -> list[str]:
    """Causes that explain as well as `name` does: nearly its signature, or nearly its evidence."""
    rest = tuple(n for n in best if n != name)
    scores = rivals(search, best, name)
    competition = search.competition(rest)
    found = []
    for other, evidence in scores.items():
        if other == name or other in best or evidence < scores[name] - search.threshold:
            continue
        near = evidence > scores[name] - CLASS_MARGIN
        if near or (competition.likeness(name, other) > ALIKE and evidence > scores[name] - 2 * CLASS_MARGIN):
            found.append(other)
    return sorted(found, key=lambda other: -scores[other])


def shares(evidence: dict[str, float], none: float) -> tuple[float, dict[str, float]]:
    """Probability of none of them and of each, equal before the data, half of it on none."""
    logs = np.array([none, *(value - np.log(max(len(evidence), 1)) for value in evidence.values())])
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    return float(weights[0]), dict(zip(evidence, weights[1:].tolist(), strict=True))
