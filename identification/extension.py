"""The extended vehicle: the file as it was, with what a diagnosis found written into it.

Comments and order of the file stay. A number that stands there is changed in the unit in which it stands; one that
the file leaves at its default, and a term that was not in force, are added in SI units.
"""

import hashlib
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray
from tomlkit.items import InlineTable

import assets
from flightlog.units import to_si
from identification.model import NEUTRAL
from sim import kinds, sensors, terms
from sim.parameters import Parameter
from sim.terms.table import TABLES
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]

DIGITS = 9  # of a value that is written
CHUNK = 1 << 20  # [bytes] read at a time


@dataclass(frozen=True, eq=False)
class Delta:
    """What is to be changed: K numbers by key, SI."""

    values: Mapping[str, float]  # absolute
    causes: Mapping[str, str]  # by key, what changes it
    units: Mapping[str, str]  # SI
    covariance: Floats  # (K, K) in the order of `values`
    visited: Mapping[str, tuple[float, float]]  # `height_m`, `speed_m_s`, ...: least and greatest on the flights


def extended(before: Vehicle, delta: Delta, logs: Mapping[str, str], folder: Path | None = None) -> str:
    """The text of the extended vehicle file.

    Args:
        before: the vehicle that was diagnosed.
        delta: what is changed in it.
        logs: SHA-256 by name of the log.
        folder: where the file will lie, so that the model's MJCF is found from there.
    """
    document = _document(before)
    order = sorted(range(len(delta.values)), key=lambda i: list(delta.values)[i])
    keys = [list(delta.values)[i] for i in order]
    covariance = np.asarray(delta.covariance, float)[np.ix_(order, order)]
    for i, key in enumerate(keys):
        std = float(np.sqrt(max(covariance[i, i], 0.0)))
        source = f"helideck diagnose: {delta.causes[key]}; was {{}}"
        _put(document, key, _inside(key, delta.values[key]), std, delta.units[key], source)
    document.pop("extension", None)
    document.append("extension", _provenance(before, delta, keys, covariance, logs))
    if folder is not None and "model" in document:
        document["model"] = _model(before, folder)
    return tomlkit.dumps(document)


def write(before: Vehicle, delta: Delta, logs: Mapping[str, str], path: Path) -> kinds.AnyVehicle:
    """Write the extended file and load it again; UserError where what was found makes no vehicle."""
    path.write_text(extended(before, delta, logs, path.parent), encoding="utf-8")
    return kinds.load(path)


def digest(path: Path) -> str:
    """SHA-256 of a log: of the file, or of a folder's measured tables in the order of their names."""
    found = hashlib.sha256()
    inside = path / "measured" if (path / "measured").is_dir() else path
    files = sorted(item for item in inside.rglob("*") if item.is_file()) if inside.is_dir() else [inside]
    for file in files:
        found.update(file.name.encode())
        with file.open("rb") as stream:
            while chunk := stream.read(CHUNK):
                found.update(chunk)
    return found.hexdigest()


def _document(before: Vehicle) -> tomlkit.TOMLDocument:
    """The file as written, comments included, where it still says what was diagnosed."""
    if before.path.is_file() and before.path.suffix == ".toml":
        text = before.path.read_text(encoding="utf-8")
        if tomllib.loads(text) == before.document:
            return tomlkit.parse(text)
    return tomlkit.parse(tomlkit.dumps(before.document))


def _put(document: Any, key: str, value: float, std: float, unit: str, source: str) -> None:
    """Set one number; `source` has a place for what it was."""
    *way, name = key.split(".")
    node: Any = document
    own = document["kind"] == "helicopter"  # whose terms want all their numbers; those of other kinds may be left out
    if own and way[:1] == ["terms"] and len(way) == 2 and way[1] not in document["terms"]:
        _add_term(document, way[1], source)
    for part in way:
        if isinstance(node, list):
            node = node[int(part)]
            continue
        if part not in node:
            node[part] = tomlkit.table()
        node = node[part]
    if isinstance(node, Mapping) and "value" in node and name.isdecimal():  # one of a vector
        index = int(name)
        _set(node, value, std, unit, source, index)
    elif name in node:
        _set(node[name], value, std, unit, source, None)
    else:
        declared = _declared(key)
        was = "0" if declared is None or declared.default is None else f"{declared.default:g}"
        node[name] = _number(value, unit, std, source.format(f"not in the file: {was}"))


def _set(number: Any, value: float, std: float, unit: str, source: str, index: int | None) -> None:
    """Change a number that stands there, in its own unit."""
    zero = to_si(0.0, number["unit"], unit)
    scale = to_si(1.0, number["unit"], unit) - zero
    written = _rounded((value - zero) / scale)
    if index is None:
        number["source"] = source.format(f"{float(number['value']):g}")
        number["value"] = written
        number["tolerance"] = _rounded(std / abs(scale))
        return
    number["source"] = source.format([float(v) for v in number["value"]])
    number["value"][index] = written
    given = number.get("tolerance", 0.0)
    spread = [float(v) for v in given] if isinstance(given, list) else [float(given)] * len(number["value"])
    spread[index] = _rounded(std / abs(scale))
    number["tolerance"] = spread


def _add_term(document: Any, name: str, source: str) -> None:
    """A term that was not in force, with numbers that do nothing."""
    table = tomlkit.table()
    neutral = NEUTRAL.get(name, {})
    for p in terms.KNOWN[name].parameters:
        value = neutral.get(p.name, 0.0 if name in TABLES else p.default)
        if value is None:
            raise KeyError(f"{name}.{p.name}: no value that does nothing is known")
        table.append(p.name, _number(value, p.unit, 0.0, source.format("not in force")))
    document["terms"].append(name, table)


def _number(value: float, unit: str, std: float, source: str) -> InlineTable:
    table = tomlkit.inline_table()
    table.update({"value": _rounded(value), "unit": unit, "tolerance": _rounded(std), "source": source})
    return table


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _declared(key: str) -> Parameter | None:
    """The declaration of a term's or a sensor's number."""
    section, member, name, *_ = [*key.split("."), "", "", ""]
    known: Sequence[Parameter] = ()
    if section == "terms" and member in terms.KNOWN:
        known = terms.KNOWN[member].parameters
    elif section == "sensors" and member in sensors.CATALOGUE:
        known = sensors.CATALOGUE[member].PARAMETERS
    return next((p for p in known if p.name == name), None)


def _inside(key: str, value: float) -> float:
    """The value, or the end of the declared range that it lies beyond."""
    declared = _declared(key)
    return value if declared is None else min(max(value, declared.low), declared.high)


def _model(before: Vehicle, folder: Path) -> str:
    """How the MJCF is found from a folder: by its bare name where it comes with the project."""
    given, beside = str(before.document["model"]), before.path.parent / str(before.document["model"])
    if not beside.is_file() or beside.is_relative_to(assets.path("vehicles")):
        return given
    return Path(os.path.relpath(beside, folder)).as_posix()


def _provenance(before: Vehicle, delta: Delta, keys: Sequence[str], covariance: Floats, logs: Mapping[str, str]) -> Any:
    table = tomlkit.table()
    table.add(tomlkit.comment("written by `helideck diagnose`: what the changes come from, and where they hold"))
    table.add("of", before.name)
    table.add("of_sha256", hashlib.sha256(tomlkit.dumps(before.document).encode()).hexdigest())
    table.add("causes", sorted(set(delta.causes.values())))
    table.add("by", f"helideck {version('helideck')}")
    table.add("logs", [{"log": name, "sha256": found} for name, found in sorted(logs.items())])
    rows = [[_rounded(v) for v in row] for row in covariance.tolist()]
    table.add("covariance", {"keys": list(keys), "matrix": rows})
    visited = {name: [_rounded(low), _rounded(high)] for name, (low, high) in delta.visited.items()}
    table.add("visited", visited)
    return table
