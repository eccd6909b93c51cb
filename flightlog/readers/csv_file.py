"""A CSV file as columns: unpacked, decoded, numbers where they are numbers; what is broken is left out and told."""

import zlib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from flightlog.errors import UserError
from flightlog.readers.log import Draft

Floats = NDArray[np.float64]

GZIP = b"\x1f\x8b"
SEPARATORS = (",", ";", "\t")
NUMBER = r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"
WORDS = {"true": "1", "false": "0", "nan": "", "null": "", "none": "", "na": "", "n/a": "", "-": ""}
INFINITE = r"^[+-]?(inf|infinity)$"


def read_columns(path: Path, draft: Draft) -> dict[str, NDArray]:  # type: ignore[type-arg]
    """The file's columns by name: numbers as float64 (N,), NaN where a cell is empty; text as objects."""
    text = _text(path, draft)
    lines = text.lstrip()
    while lines.startswith("#"):  # remarks before the header
        lines = lines.partition("\n")[2].lstrip()
    header = lines.partition("\n")[0].strip("\r")
    if not header.strip():
        raise UserError(f"{path}: empty; a header and rows would be right")
    separator = max(SEPARATORS, key=header.count)
    left_out: list[int] = []

    def skip(row: pacsv.InvalidRow) -> str:
        left_out.append(row.expected_columns)
        return "skip"

    data = lines.encode()
    try:
        raw = pacsv.read_csv(
            pa.BufferReader(data),
            read_options=pacsv.ReadOptions(block_size=len(data) + 1, use_threads=False),
            parse_options=pacsv.ParseOptions(delimiter=separator, invalid_row_handler=skip),
            convert_options=pacsv.ConvertOptions(column_types=_as_text(header, separator), strings_can_be_null=False),
        )
    except (pa.ArrowException, ValueError, OverflowError) as error:
        raise UserError(f"{path}: not a CSV file: {str(error).splitlines()[0]}") from None
    if left_out:
        draft.note(f"{path.name}: {len(left_out)} row(s) left out that do not have {raw.num_columns} values")
    names = [name.strip() for name in raw.column_names]
    twice = sorted({name for name in names if name and names.count(name) > 1})
    if twice:
        raise UserError(f"{path}: two columns are named {twice[0]!r}; each must have a name of its own")
    found = {name: _numbers(name, raw.column(i), path, draft) for i, name in enumerate(names) if name}
    if not raw.num_rows:
        raise UserError(f"{path}: a header without rows")
    return found


def _as_text(header: str, separator: str) -> dict[str, pa.DataType]:
    """Every column as text: what it holds is found out afterwards, cell by cell where need be."""
    fields = pacsv.read_csv(
        pa.BufferReader(header.encode() + b"\n"), parse_options=pacsv.ParseOptions(delimiter=separator)
    ).column_names
    return dict.fromkeys(fields, pa.string())


def _numbers(name: str, column: pa.ChunkedArray, path: Path, draft: Draft) -> NDArray:  # type: ignore[type-arg]
    """A column of text as numbers where it holds numbers."""
    text = pc.utf8_trim_whitespace(column)
    empty = pc.equal(text, "")
    try:
        return _floats(pc.if_else(empty, pa.scalar(None, pa.string()), text))
    except pa.ArrowInvalid:
        pass
    lower = pc.utf8_lower(text)
    for word, meaning in WORDS.items():
        lower = pc.if_else(pc.equal(lower, word), meaning, lower)
    number = pc.or_(pc.match_substring_regex(lower, NUMBER), pc.match_substring_regex(lower, INFINITE))
    blank = pc.equal(lower, "")
    wrong = np.flatnonzero(~np.asarray(pc.or_(number, blank)))
    if 2 * len(wrong) > len(column) - int(pc.sum(blank).as_py() or 0):
        return np.array(column.to_pylist(), object)
    if len(wrong):
        cell = str(column[int(wrong[0])].as_py())[:20]
        first = f"the first {cell!r} (row {wrong[0] + 1})"
        draft.note(f"{path.name}: {len(wrong)} cell(s) of {name} hold no number, {first}")
    return _floats(pc.if_else(number, lower, pa.scalar(None, pa.string())))


def _floats(text: pa.ChunkedArray) -> Floats:
    return np.array(pc.cast(text, pa.float64()).to_numpy(zero_copy_only=False), float)


def _text(path: Path, draft: Draft) -> str:
    """The file as text: unpacked, and decoded by its mark of byte order."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from None
    if data.startswith(GZIP):
        data = _unpacked(data, path, draft)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "utf-16"
    else:
        encoding = "utf-8-sig"
        text = data.rstrip(b"\0")
        if len(text) < len(data):
            draft.note(f"{path.name}: ends in {len(data) - len(text)} zero byte(s), left out")
            data = text
        if b"\0" in data:
            raise UserError(f"{path}: not a CSV file: byte {data.index(0)} is zero, which no text holds")
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        draft.note(f"{path.name}: byte {error.start} is no {encoding.removesuffix('-sig').upper()}; read as Latin 1")
        return data.decode("latin-1")


def _unpacked(data: bytes, path: Path, draft: Draft) -> bytes:
    """All that can be unpacked of gzip members, one after the other."""
    parts = []
    while data.startswith(GZIP):
        stream = zlib.decompressobj(wbits=31)
        try:
            for start in range(0, len(data), 1 << 20):  # piecewise, so that what comes before a fault is kept
                parts.append(stream.decompress(data[start : start + (1 << 20)]))
                if stream.eof:
                    break
        except zlib.error as error:
            draft.note(f"{path.name}: the packed file is broken ({error}); read as far as it goes")
            break
        if not stream.eof:
            draft.note(f"{path.name}: the packed file breaks off; read as far as it goes")
            break
        data = data[start + len(data[start : start + (1 << 20)]) - len(stream.unused_data) :]
    text = b"".join(parts)
    if not text:
        raise UserError(f"{path}: a packed file from which nothing can be unpacked")
    return text

