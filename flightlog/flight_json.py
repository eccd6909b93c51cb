"""JSON as RFC 8259 wants it: null where a number is not finite, never NaN."""

import contextlib
import dataclasses
import json
import math
import os
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from flightlog.errors import UserError

NAME = "flight.json"


def plain(value: Any) -> Any:
    """`value` made of what JSON knows: dataclasses, mappings, sequences and arrays taken apart, NaN and inf to None."""
    if value is None or isinstance(value, (str, bool, int)):
        return value.value if isinstance(value, Enum) else value
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if hasattr(value, "model_dump"):
        return plain(value.model_dump(mode="json"))
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        items = [plain(item) for item in value]
        return sorted(items) if isinstance(value, (set, frozenset)) else items
    return str(value)


def dumps(document: Any, indent: int | None = 2) -> str:
    """The document as JSON text."""
    return json.dumps(plain(document), indent=indent, allow_nan=False, ensure_ascii=False)


def write_flight(folder: Path, document: Mapping[str, Any]) -> None:
    """Write flight.json whole or not at all: a reader never meets half a file."""
    path = folder / NAME
    draft = folder / (NAME + ".part")
    try:
        draft.write_text(dumps(document) + "\n", encoding="utf-8")
        os.replace(draft, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            draft.unlink()
        raise UserError(f"{path}: cannot be written: {error.strerror}") from None


def read_flight_json(folder: Path) -> dict[str, Any]:
    """What flight.json says; UserError where the folder is no flight."""
    path = folder / NAME
    if not folder.exists():
        raise UserError(f"{folder}: no such folder; a flight is a folder that `helideck land` wrote")
    if not folder.is_dir():
        raise UserError(f"{folder}: a file; a flight is a folder with {NAME} and measured/")
    if not path.is_file():
        raise UserError(f"{folder}: no flight: {NAME} is missing; a flight is a folder that `helideck land` wrote")
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise UserError(f"{path}: not valid JSON: {error}") from None
    if not isinstance(document, dict):
        raise UserError(f"{path}: holds {type(document).__name__}; an object {{...}} would be right")
    return document
