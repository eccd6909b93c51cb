"""Verdicts as they are told: one of several alike by its common name with its number, added parts by where they sit."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from identification.causes.contract import Cause
from identification.verdict import Asserted, Fitted, Verdict

PLACE = ("x", "y")


def told(verdict: Verdict, causes: Mapping[str, Cause]) -> Verdict:
    """Names without the search's numbers; `rotor` and the like as parameters; causes: by the search's names."""

    def title(name: str) -> str:
        return causes[name].title if name in causes else name

    def others(found: Asserted) -> list[str]:
        alike = dict.fromkeys(title(name) for name in found.confusable_with)
        return [name for name in alike if name != title(found.name)]

    return replace(
        verdict,
        causes=[
            replace(
                found, name=title(found.name), confusable_with=others(found), parameters=_parameters(found, causes),
                topic=causes[found.name].topic if found.name in causes else None,
            )
            for found in verdict.causes
        ],
        candidates=[replace(candidate, name=title(candidate.name)) for candidate in verdict.candidates],
    )


def _parameters(found: Asserted, causes: Mapping[str, Cause]) -> dict[str, Fitted]:
    parameters = dict(found.parameters)
    cause = causes.get(found.name)
    if cause is None:
        return parameters
    keys = {p.name: p.key for p in cause.parameters}
    if keys.get("x") == "terms.payload.x":
        parameters |= _placed(parameters)
    for name, value in cause.fixed.items():
        parameters[name] = Fitted(float(value), float(value), 0.0, (float(value), float(value)), "1")
    return parameters


def _placed(parameters: Mapping[str, Fitted]) -> dict[str, Fitted]:
    """Where the added (or missing) part sits, from its mass and from how far it moved the centre of mass."""
    mass = parameters["mass"]
    added = mass.value - mass.nominal
    if added == 0.0:
        return {}
    found = {}
    for axis in PLACE:
        shift = parameters[axis]
        place = shift.value * mass.value / added
        std = float(np.hypot(shift.std * mass.value / added, place * mass.std / added))
        found[axis] = Fitted(place, 0.0, abs(std), (place - 1.96 * abs(std), place + 1.96 * abs(std)), "m")
    return found
