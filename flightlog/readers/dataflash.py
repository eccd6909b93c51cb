"""ArduPilot DataFlash, binary or text, as messages: columns by name, each row with its place in the file.

A binary message is the bytes a3 95, its type, and fields packed as the log's own FMT messages say. Rows are gathered
by numpy type by type, so a log of hours is read in seconds; what lies broken between messages is skipped and told.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightlog.errors import UserError

Floats = NDArray[np.float64]

MAGIC = b"\xa3\x95"
FMT = 128  # the message that tells the others' fields
HEADER = 3  # [bytes]

# character of a format -> (numpy's type, factor)
_FIELDS: Mapping[str, tuple[str, float]] = {
    "b": ("i1", 1.0), "B": ("u1", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0), "i": ("<i4", 1.0), "I": ("<u4", 1.0),
    "q": ("<i8", 1.0), "Q": ("<u8", 1.0), "f": ("<f4", 1.0), "d": ("<f8", 1.0), "g": ("<f2", 1.0),
    "c": ("<i2", 1e-2), "C": ("<u2", 1e-2), "e": ("<i4", 1e-2), "E": ("<u4", 1e-2), "L": ("<i4", 1e-7),
    "M": ("u1", 1.0), "n": ("S4", 0.0), "N": ("S16", 0.0), "Z": ("S64", 0.0), "a": ("<i2", 0.0),
}  # fmt: skip
_TEXT = "nNZ"


@dataclass(frozen=True, eq=False)
class Messages:
    """All messages of one name."""

    name: str
    columns: Mapping[str, NDArray]  # type: ignore[type-arg]  # (N,) float64, or texts
    formats: Mapping[str, str]  # by column, the character of its format
    place: NDArray[np.int64]  # (N,) where each stands in the file: byte or line

    def __len__(self) -> int:
        return len(self.place)

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    def __getitem__(self, column: str) -> Floats:
        return self.columns[column]

    def first(self, *names: str) -> str | None:
        """The first of these columns that there is."""
        return next((name for name in names if name in self.columns), None)

    def only(self, rows: NDArray[np.bool_]) -> "Messages":
        """Some of the rows."""
        return Messages(self.name, {n: v[rows] for n, v in self.columns.items()}, self.formats, self.place[rows])


@dataclass(frozen=True)
class _Format:
    name: str
    types: str
    columns: tuple[str, ...]
    length: int  # [bytes] with the header

    @property
    def sound(self) -> bool:
        """Whether each column has a type and a name of its own."""
        return len(self.columns) == len(self.types) == len(set(self.columns))


def parse(path: Path) -> tuple[dict[str, Messages], list[str]]:
    """(messages by name, notes on what could not be read) of a log; UserError where it is none."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from None
    text = re.search(rb"^FMT\s*,", data, re.MULTILINE) is not None and not data.startswith(MAGIC)
    messages, notes = _text(data) if text else _binary(data)
    if not messages:
        raise UserError(f"{path}: a DataFlash log without messages")
    return messages, [f"{path.name}: {note}" for note in notes]


# --- binary -----------------------------------------------------------------------------------------------------------


def _binary(data: bytes) -> tuple[dict[str, Messages], list[str]]:
    formats = {FMT: _Format("FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"), 89)}
    lengths = [0] * 256
    lengths[FMT] = 89
    places: list[list[int]] = [[] for _ in range(256)]
    earlier: list[tuple[_Format, list[int]]] = []  # of types that were declared anew
    notes: list[str] = []
    position, size = 0, len(data)
    skipped, first_skipped, cut = 0, -1, False
    while position + HEADER <= size:
        kind = data[position + 2]
        length = lengths[kind]
        if not data.startswith(MAGIC, position) or not length or _no_format(data, position, length, kind):
            onward = data.find(MAGIC, position + 1)
            onward = size if onward < 0 else onward
            first_skipped = position if first_skipped < 0 else first_skipped
            skipped += onward - position
            position = onward
            continue
        if position + length > size:
            cut = True
            break
        if kind == FMT:
            found = _format(data[position + HEADER : position + length], notes)
            if found is not None:
                number, form = found
                if places[number] and form != formats[number]:
                    earlier.append((formats[number], places[number]))
                    places[number] = []
                formats[number], lengths[number] = form, form.length
        places[kind].append(position)
        position += length
    if skipped:
        notes.append(f"{skipped} byte(s) skipped that are no message, the first at {first_skipped}")
    if cut or (position < size and not skipped):
        notes.append(f"ends in the middle of a message, {size - position} byte(s) after the last whole one")
    block = np.frombuffer(data, np.uint8)
    messages: dict[str, Messages] = {}
    last = [(formats[kind], offsets) for kind, offsets in enumerate(places) if offsets and kind != FMT]
    for form, offsets in (*earlier, *last):
        _merge(messages, _rows(block, np.array(offsets), form))
    return messages, notes


def _no_format(data: bytes, position: int, length: int, kind: int) -> bool:
    """Whether what says that it is a FMT message is another, whose type was broken: senseless, and it holds a message.

    To believe it would cost all messages within its 89 bytes.
    """
    body = data[position + HEADER : position + length]
    if kind != FMT or MAGIC not in body:
        return False
    doubts: list[str] = []
    itself = body[0] == FMT and body[1] == length
    return not itself and (_format(body, doubts) is None or bool(doubts))


def _format(body: bytes, notes: list[str]) -> tuple[int, _Format] | None:
    """(type, format) from the body of a FMT message; None where it makes no sense."""
    kind, length = body[0], body[1]
    name, types, columns = (
        part.split(b"\0")[0].decode("ascii", "replace").strip() for part in (body[2:6], body[6:22], body[22:86])
    )
    names = tuple(column.strip() for column in columns.split(",")) if columns else ()
    if kind == FMT:
        return None
    size = sum(64 if c == "a" else np.dtype(_FIELDS[c][0]).itemsize for c in types if c in _FIELDS)
    known = all(c in _FIELDS for c in types) and len(names) == len(types) and length == size + HEADER
    if not known or not name.isidentifier() or len(set(names)) < len(names):
        if length <= HEADER:
            return None
        notes.append(f"messages {name!r} left out: their format {types!r}, {columns!r} does not fit {length} bytes")
        return kind, _Format(name, "", (), length)
    return kind, _Format(name, types, names, length)


def _rows(block: NDArray[np.uint8], offsets: NDArray[np.int64], form: _Format) -> Messages:
    """The messages of one type at these offsets."""
    fields = [(str(i), ("<i2", (32,)) if c == "a" else _FIELDS[c][0]) for i, c in enumerate(form.types)]
    packed = np.dtype(fields)
    columns: dict[str, NDArray] = {}  # type: ignore[type-arg]
    if packed.itemsize:
        gathered = block[offsets[:, None] + np.arange(HEADER, HEADER + packed.itemsize)]
        values = np.ascontiguousarray(gathered).view(packed)[:, 0]
        for index, (name, kind) in enumerate(zip(form.columns, form.types, strict=True)):
            column = values[str(index)]
            if kind in _TEXT:
                columns[name] = np.char.decode(column, "ascii", "replace")
            elif kind != "a":
                factor = _FIELDS[kind][1]
                columns[name] = column * factor if factor != 1.0 else column.astype(float)
    kinds = {name: c for name, c in zip(form.columns, form.types, strict=True) if c != "a"}
    return Messages(form.name, columns, kinds, offsets)


def _merge(messages: dict[str, Messages], found: Messages) -> None:
    """Put messages beside those of the same name and columns; a format declared twice is one."""
    known = messages.get(found.name)
    if known is None:
        messages[found.name] = found
    elif known.columns.keys() == found.columns.keys():
        place = np.concatenate([known.place, found.place])
        order = np.argsort(place, kind="stable")
        columns = {n: np.concatenate([v, found.columns[n]])[order] for n, v in known.columns.items()}
        messages[found.name] = Messages(found.name, columns, known.formats, place[order])
    elif len(found) > len(known):
        messages[found.name] = found


# --- text -------------------------------------------------------------------------------------------------------------


def _text(data: bytes) -> tuple[dict[str, Messages], list[str]]:
    """A log written out as lines `NAME, value, value, ...`; the values are scaled already."""
    formats: dict[str, _Format] = {}
    rows: dict[_Format, list[list[str]]] = {}  # a format declared anew begins anew
    places: dict[_Format, list[int]] = {}
    broken, first_broken = 0, -1
    lines = data.decode("utf-8", "replace").splitlines()
    for number, line in enumerate(lines):
        name, comma, rest = line.partition(",")
        name = name.strip()
        if not comma:
            continue
        if name == "FMT":
            parts = [part.strip() for part in rest.split(",")]
            if len(parts) >= 4 and parts[1].isdigit():
                columns = tuple(part for part in parts[4:] if part)
                formats[parts[2]] = _Format(parts[2], parts[3], columns, int(parts[1]))
            continue
        form = formats.get(name)
        if form is None:
            continue
        values = [value.strip() for value in rest.split(",", max(0, len(form.columns) - 1))]
        if len(values) != len(form.columns) or not form.sound:
            broken += 1
            first_broken = number + 1 if first_broken < 0 else first_broken
            continue
        rows.setdefault(form, []).append(values)
        places.setdefault(form, []).append(number)
    notes = []
    if broken:
        notes.append(f"{broken} line(s) left out that do not have the values their format says, the first line "
                     f"{first_broken}")  # fmt: skip
    if lines and not data.endswith((b"\n", b"\r")):
        notes.append("the last line has no end: the log may break off there")
    messages: dict[str, Messages] = {}
    for form, found in rows.items():
        name = form.name
        cells = [np.array(values) for values in zip(*found, strict=True)]
        columns_found: dict[str, NDArray] = {}  # type: ignore[type-arg]
        for column, kind, cell in zip(form.columns, form.types, cells, strict=True):
            columns_found[column] = cell if kind in _TEXT + "M" else _floats(cell, f"{name}.{column}", notes)
        kinds = dict(zip(form.columns, form.types, strict=True))
        _merge(messages, Messages(name, columns_found, kinds, np.array(places[form])))
    return messages, notes


def _floats(values: NDArray, column: str, notes: list[str]) -> Floats:  # type: ignore[type-arg]
    """Texts (N,) as numbers; NaN where one is none."""
    try:
        return values.astype(float)
    except ValueError:
        pass
    numbers = np.full(len(values), np.nan)
    wrong = 0
    for index, value in enumerate(values.tolist()):
        try:
            numbers[index] = float(value)
        except ValueError:
            wrong += 1
    notes.append(f"{wrong} value(s) of {column} are no numbers")
    return numbers
