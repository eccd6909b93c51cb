"""TOML files of the user's, checked against a pydantic model: every fault in one clear line with its place."""

import difflib
import json
import os
import re
import tomllib
import types
import typing
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from flightlog.errors import UserError

Model = TypeVar("Model", bound=BaseModel)
Location = tuple[str | int, ...]

VEHICLE = "vehicle."  # `--set` keys that begin so are the vehicle file's
_LONGEST = 60  # characters of a wrong value that are shown

# pydantic's type of fault -> what would be right
_WANTED = {
    "float_type": "a number", "int_type": "a whole number", "int_from_float": "a whole number",
    "string_type": "text in quotes", "bool_type": "true or false", "list_type": "a list [...]",
    "dict_type": "a table {...}", "model_type": "a table {...}", "model_attributes_type": "a table {...}",
    "finite_number": "a finite number",
}  # fmt: skip
_BOUNDS = {"greater_than": ("gt", "more than"), "greater_than_equal": ("ge", "at least"),
           "less_than": ("lt", "less than"), "less_than_equal": ("le", "at most"),
           "too_short": ("min_length", "a list of at least"),
           "too_long": ("max_length", "a list of at most")}  # fmt: skip


def read(path: Path) -> dict[str, Any]:
    """The document in the file; UserError where it is missing or no TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not valid TOML: byte {error.start} is no UTF-8 text") from None
    except RecursionError:
        raise UserError(f"{path}: not valid TOML: nested too deeply") from None
    except ValueError as error:
        raise UserError(f"{path}: not valid TOML: {_one_line(str(error))}") from None


def validate(
    document: Mapping[str, Any], model: type[Model], path: Path | str, settings: Collection[str] = ()
) -> Model:
    """`document` as `model`; UserError names file, line, key, what was found and what would be right.

    Where several things are wrong it names the first and counts the others. settings: dotted keys that came from
    `--set`, not from the file; a fault in one of them is put down to the setting.
    """
    try:
        return model.model_validate(document)
    except ValidationError as error:
        text = Path(path).read_text(encoding="utf-8") if os.path.isfile(path) else ""
        lines = _lines(error, model, document, text, str(path), settings)
        more = len(lines) - 1
        rest = f" (and {more} more fault{'s' if more > 1 else ''})" if more else ""
        raise UserError(lines[0] + rest) from None


def place(path: Path | str, dotted: str, settings: Collection[str] = ()) -> str:
    """Where a key stands, the way an error message begins: `--set a.b`, or file, line and key."""
    location: Location = tuple(dotted.split("."))
    setting = _setting(settings, location)
    if setting is not None:
        return f"--set {setting}"
    line = _line_of(Path(path).read_text(encoding="utf-8"), location) if os.path.isfile(path) else None
    return f"{path}:{line}: {dotted}" if line else f"{path}: {dotted}"


def nearest(name: str, known: typing.Iterable[str]) -> str:
    """The end of an error message about an unknown name: the nearest right one, or all of them."""
    known = sorted(known)
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"


def assign(document: dict[str, Any], dotted: str, value: Any) -> None:
    """Set `a.b.c` in the document, the way of `--set`; tables on the way are made, an entry of a list by number."""
    target: Any = document
    *way, key = dotted.split(".")
    if not all((*way, key)):
        raise UserError(f"--set {dotted}: write the key as a.b.c")
    for part in way:
        target = target[_entry(target, part, dotted)] if isinstance(target, list) else target.setdefault(part, {})
        if not isinstance(target, dict | list):
            raise UserError(f"--set {dotted}: {part!r} is no table")
    if isinstance(target, list):
        target[_entry(target, key, dotted)] = value
    # a number with unit and source keeps them: only its value changes
    elif isinstance(target.get(key), dict) and "value" in target[key] and not isinstance(value, dict):
        target[key] = {**target[key], "value": value}
    else:
        target[key] = value


def parse_value(text: str) -> Any:
    """A value as TOML writes it; a bare word is a string."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text


def _entry(entries: list[Any], part: str, dotted: str) -> int:
    if not part.isdecimal() or int(part) >= len(entries):
        raise UserError(f"--set {dotted}: {part!r} is none of the list's entries, 0 to {len(entries) - 1}")
    return int(part)


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _lines(
    error: ValidationError, model: type[BaseModel], document: Any, text: str, path: str, settings: Collection[str]
) -> list[str]:
    """One line a fault: unknown keys first, as they are the reason for missing ones; then by their place."""
    found: dict[Location, tuple[int, int, str]] = {}
    for fault in error.errors(include_url=False):
        location = _in_document(fault["loc"], document)
        if fault["type"] == "union_tag_invalid":
            location = (*location, "kind")
        if location in found or any(known[: len(location)] == location for known in found):
            continue  # another way in which the same value is wrong
        for outer in [known for known in found if location[: len(known)] == known]:
            del found[outer]
        rank = {"extra_forbidden": 0, "missing": 2}.get(fault["type"], 1)
        line = _line_of(text, location)
        setting = _setting(settings, location)
        if setting is not None:
            start = f"--set {setting}"
        elif line:
            start = f"{path}:{line}: {_key(location)}"
        else:
            start = f"{path}: {_key(location)}" if location else path
        found[location] = (rank, line or 0, f"{start}: {_message(fault, model)}")
    return [line for _, _, line in sorted(found.values(), key=lambda item: item[:2])]


def _setting(settings: Collection[str], location: Location) -> str | None:
    """The setting in which a fault lies, or which made the table in which it lies."""
    keys = [str(part) for part in location]
    for dotted in settings:
        parts = dotted.removeprefix(VEHICLE).split(".")
        shorter = min(len(parts), len(keys))
        if keys and parts[:shorter] == keys[:shorter]:
            return dotted
    return None


def _message(fault: Any, model: type[BaseModel]) -> str:
    """What is wrong and what would be right."""
    kind, context, location = fault["type"], fault.get("ctx", {}), fault["loc"]
    shown = repr(fault["input"])
    got = f"(got {shown if len(shown) <= _LONGEST else shown[:_LONGEST] + ' ...'})"
    if kind == "extra_forbidden":
        return f"unknown key; {nearest(str(location[-1]), _known_keys(model, location[:-1]))}"
    if kind == "missing":
        return "is missing"
    if kind == "union_tag_invalid":
        return f"there is no {context['tag']!r}; {nearest(context['tag'], _quoted(context['expected_tags']))}"
    if kind == "union_tag_not_found":
        return f"{context['discriminator'].strip(chr(39))} is missing"
    if kind == "literal_error":
        return f"there is no {fault['input']!r}; {nearest(str(fault['input']), _quoted(context['expected']))}"
    if kind in _WANTED:
        return f"must be {_WANTED[kind]} {got}"
    if kind in _BOUNDS:
        name, words = _BOUNDS[kind]
        return f"must be {words} {context[name]:g} {got}"
    if kind == "value_error":
        return _one_line(fault["msg"].removeprefix("Value error, "))
    return f"{_one_line(fault['msg'])} {got}"


def _quoted(names: str) -> list[str]:
    """The names in pydantic's list of them."""
    return re.findall(r"'([^']*)'", names)


def _key(location: Location) -> str:
    """The location as TOML writes a key."""
    parts = [str(part) for part in location]
    return ".".join(p if re.fullmatch(r"[\w-]+", p) else json.dumps(p) for p in parts)


def _in_document(location: Location, document: Any) -> Location:
    """The location without the names of a union's members, which pydantic puts into it."""
    kept: list[str | int] = []
    node, tagged = document, False
    for index, part in enumerate(location):
        last = index == len(location) - 1
        if isinstance(node, Mapping):
            if (not tagged and node.get("kind") == part) or (not last and part not in node):
                tagged = True
                continue
            kept.append(part)
            node, tagged = node.get(part), False
        elif isinstance(node, list) and isinstance(part, int) and part < len(node):
            kept.append(part)
            node, tagged = node[part], False
    return tuple(kept)


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
            if table == keys[: len(table)]:
                best = number
        elif entry := re.match(r'\s*"?([\w-]+)"?\s*=', line):
            path = [*table, entry[1]]
            if path == keys[: len(path)]:
                return number
    return best
