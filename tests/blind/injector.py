"""Draws a blind set from a seed, flies it, writes what was measured, and seals the answer.

A set is some flights of one vehicle: a helicopter, a quadrotor, a rig. The answer (what is wrong, by how much, what
flew) goes to a place of its own; beside the flights lies its hash alone, written before anybody judges.
"""

import hashlib
import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from flightlog.flight_json import plain
from tests.blind.kits import Kit, kit_of

Kind = Literal["null", "single", "pair", "unknown", "weak"]
WEAK = 0.04  # share of the usual size that nobody can see


@dataclass(frozen=True)
class Told:
    """One effect as the answer tells it."""

    name: str
    where: str
    form: str
    values: Mapping[str, float]
    which: str = ""  # rotor, joint or input


@dataclass(frozen=True)
class Answer:
    """What is true of a set."""

    seed: int
    kind: Kind
    vehicle: str  # the nominal one
    effects: tuple[Told, ...]
    plans: tuple[str, ...]
    without: tuple[str, ...]  # topics that were left out
    stress: bool
    document: Mapping[str, Any] = field(repr=False)  # vehicle file of what flew, foreign terms left out
    before: Mapping[str, Any] = field(repr=False)  # the same with nothing wrong
    shows: tuple[str, str] | None = None  # of an unknown effect: channel, what it depends on

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects."""
        return tuple(effect.name for effect in self.effects)


@dataclass(frozen=True, eq=False)
class Set:
    """A set as it is handed to whoever judges: flights, the nominal vehicle's name, the seal."""

    folder: Path
    flights: tuple[Path, ...]
    vehicle: str
    seal: str  # SHA-256 of the answer
    heldout: tuple[Path, ...] = ()  # further flights of the same vehicle
    normal: tuple[Path, ...] = ()  # flights of it before anything was wrong

    def open(self, answers: Path) -> Answer:
        """The answer; ValueError where it is not the one that was sealed."""
        text = (answers / f"{self.folder.name}.json").read_text()
        if hashlib.sha256(text.encode()).hexdigest() != (self.folder / "answer.sha256").read_text().strip():
            raise ValueError(f"{self.folder}: the answer is not the one that was sealed")
        told = json.loads(text)
        told["effects"] = tuple(Told(**effect) for effect in told["effects"])
        told |= {key: tuple(told[key]) for key in ("plans", "without")}
        told["shows"] = tuple(told["shows"]) if told["shows"] else None
        return Answer(**told)


def make(
    seed: int,
    kind: Kind,
    folder: Path,
    answers: Path,
    *,
    names: Sequence[str] | None = None,
    vehicle: str = "raptor90",
    plans: Sequence[str] | None = None,
    flights: int = 3,
    heldout: int = 0,
    normal: int = 0,
    duration_s: float = 60.0,
    without: Collection[str] = (),
    stress: bool = False,
) -> Set:
    """Draw, fly and seal one set.

    Args:
        seed: everything follows from it.
        kind: nothing wrong, one or two effects, one that no catalogue holds, or one too small to be seen.
        folder: of the set, named as the set; made.
        answers: where the answer goes.
        names: of the effects, where they are not to be drawn.
        vehicle: the nominal vehicle, of `vehicles/` here or of the project.
        plans: of its kit, where they are not to be drawn.
        flights: how many to be judged.
        heldout: how many more for the gain.
        normal: how many of the same vehicle with nothing wrong.
        duration_s: of each.
        without: topics to leave out.
        stress: gusts doubled, outliers, dropouts and noise of the attitude.
    """
    rng = np.random.default_rng([seed, 20])
    kit = kit_of(vehicle)
    true = kit.draw(rng)
    chosen, shows = _choose(kit, kind, names, rng, without)
    share = WEAK if kind == "weak" else 1.0
    effects = [kit.effect(draw, true, rng, share) for draw in chosen]
    flying = kit.inject(true, effects)
    everything = [str(name) for name in rng.permutation(list(kit.plans))]
    todo = list(plans) if plans is not None else (everything * flights)[:flights]
    later = [str(name) for name in rng.choice(list(kit.plans), heldout)]
    before = [str(name) for name in rng.choice(list(kit.plans), normal)]
    answer = Answer(
        seed, kind, vehicle, tuple(Told(e.name, e.where, e.form, dict(e.values), e.which) for e in effects),
        tuple(todo), tuple(without), stress, kit.document(flying), kit.document(true),
        shows,
    )  # fmt: skip

    folder.mkdir(parents=True)
    answers.mkdir(parents=True, exist_ok=True)
    text = json.dumps(plain(asdict(answer)), sort_keys=True)
    seal = hashlib.sha256(text.encode()).hexdigest()
    (folder / "answer.sha256").write_text(seal + "\n")
    (answers / f"{folder.name}.json").write_text(text)
    paths: dict[str, tuple[Path, ...]] = {}
    count = 0
    for what, names_of, craft, wrong in (
        ("flight", todo, flying, effects), ("heldout", later, flying, effects), ("normal", before, true, []),
    ):  # fmt: skip
        paths[what] = tuple(folder / f"{what}-{i + 1}" for i in range(len(names_of)))
        for path, plan in zip(paths[what], names_of, strict=True):
            kit.fly(craft, plan, duration_s, seed * 32 + count, path, wrong, without, stress)
            count += 1
    return Set(folder, paths["flight"], vehicle, seal, paths["heldout"], paths["normal"])


def _choose(
    kit: Kit, kind: Kind, names: Sequence[str] | None, rng: np.random.Generator, without: Collection[str]
) -> tuple[list[Any], tuple[str, str] | None]:
    """The effects' draws, and how an unknown one shows."""
    if kind == "null":
        return [], None
    if kind == "unknown":
        name = names[0] if names else str(rng.choice(list(kit.unknown)))
        draw, channel, driver = kit.unknown[name]
        return [draw], (channel, driver)
    many = 2 if kind == "pair" else 1
    while names is None:
        tried = [str(name) for name in rng.choice(list(kit.effects), many, replace=False)]
        other = np.random.default_rng(0)
        probe = [kit.effect(kit.effects[name], kit.draw(other), other, 1.0) for name in tried]
        if not any(topic in without for effect in probe for topic in effect.needs):
            names = tried
    return [kit.effects[name] for name in names], None
