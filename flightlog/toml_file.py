"""TOML files of the user's, checked against a pydantic model: every fault in one clear line with its place."""

import difflib
import re
import tomllib
import types
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from flightlog.errors import UserError

Model = TypeVar("Model", bound=BaseModel)
Location = tuple[str | int, ...]


def read(path: Path) -> dict[str, Any]:
    """The document in the file; UserError where it is missing or no TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: cannot be read: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{path}: not valid TOML: {error}") from None


def validate(document: Mapping[str, Any], model: type[Model], path: Path | str) -> Model:
    """`document` as `model`; UserError names file, line, key, what was found and what would be right."""
    try:
        return model.model_validate(document)
    except ValidationError as error:
        text = Path(path).read_text(encoding="utf-8") if Path(path).is_file() else ""
        raise UserError("\n".join(_lines(error, model, text, str(path)))) from None


def nearest(name: str, known: typing.Iterable[str]) -> str:
    """The end of an error message about an unknown name: the nearest right one, or all of them."""
    known = sorted(known)
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"


def assign(document: dict[str, Any], dotted: str, value: Any) -> None:
    """Set `a.b.c` in the document, the way of `--set`; tables on the way are made."""
    *tables, key = dotted.split(".")
    target = document
    for table in tables:
        target = target.setdefault(table, {})
        if not isinstance(target, dict):
            raise UserError(f"--set {dotted}: {table!r} is no table")
    # a number with unit and source keeps them: only its value changes
    if isinstance(target.get(key), dict) and "value" in target[key] and not isinstance(value, dict):
        target[key] = {**target[key], "value": value}
    else:
        target[key] = value


def parse_value(text: str) -> Any:
    """A value as TOML writes it; a bare word is a string."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _lines(error: ValidationError, model: type[BaseModel], text: str, path: str) -> Iterator[str]:
    for fault in error.errors(include_url=False):
        location: Location = fault["loc"]
        key = ".".join(str(part) for part in location) or "document"
        message = fault["msg"].removeprefix("Value error, ")
        if fault["type"] == "extra_forbidden":
            message = f"unknown key; {nearest(str(location[-1]), _known_keys(model, location[:-1]))}"
        elif fault["type"] == "missing":
            message = "is missing"
        else:
            message += f" (got {fault['input']!r})"
        line = _line_of(text, location)
        yield f"{path}:{line}: {key}: {message}" if line else f"{path}: {key}: {message}"


def _known_keys(model: Any, location: Location) -> set[str]:
    for part in location:
        if isinstance(part, int):
            continue
        if isinstance(model, type) and issubclass(model, BaseModel):
            fields = {field.alias or name: field.annotation for name, field in model.model_fields.items()}
            model = fields.get(str(part), _variant(model, str(part)))
        elif typing.get_origin(model) in (dict, Mapping):
            model = typing.get_args(model)[1]
        else:
            model = _variant(model, str(part))
        model = _inner(model)
    if isinstance(model, type) and issubclass(model, BaseModel):
        return {field.alias or name for name, field in model.model_fields.items()}
    return set()


def _inner(annotation: Any) -> Any:
    """What a list or an optional holds."""
    origin = typing.get_origin(annotation)
    if origin in (list, tuple):
        return _inner(typing.get_args(annotation)[0])
    if origin is typing.Annotated:
        return _inner(typing.get_args(annotation)[0])
    if origin in (typing.Union, types.UnionType):
        members = [member for member in typing.get_args(annotation) if member is not type(None)]
        return _inner(members[0]) if len(members) == 1 else annotation
    return annotation


def _variant(annotation: Any, tag: str) -> Any:
    """The member of a tagged union whose `kind` is `tag`: pydantic names it in the location."""
    for member in typing.get_args(annotation):
        member = _inner(member)
        kind = getattr(member, "model_fields", {}).get("kind")
        if kind is not None and tag in typing.get_args(kind.annotation):
            return member
    return annotation


def _line_of(text: str, location: Location) -> int | None:
    """1-based line of a key, for tables written in the usual style; of its table where the key has none."""
    keys = [str(part) for part in location]
    seen: dict[tuple[str, ...], int] = {}
    table: list[str] = []
    best = None
    for number, line in enumerate(text.splitlines(), 1):
        if head := re.match(r"\s*\[(\[)?\s*([^\]]+?)\s*\]", line):
            table = [part.strip().strip('"') for part in head[2].split(".")]
            if head[1]:
                seen[tuple(table)] = seen.get(tuple(table), -1) + 1
                table = [*table, str(seen[tuple(table)])]
            if table and table == keys[: len(table)]:
                best = number
        elif entry := re.match(r'\s*"?([\w-]+)"?\s*=', line):
            path = [*table, entry[1]]
            # a tagged union puts its tag into the location: compare without what the text does not have
            if path == keys[: len(path)] or (table and path == [key for key in keys if key in path]):
                return number
    return best
