"""One entry for every kind of log: what a file is, its first bytes tell, never its name."""

import re
from pathlib import Path

import numpy as np

from flightlog.errors import UserError
from flightlog.flight_json import NAME, read_flight_json
from flightlog.readers.csv import PATTERN, read_csv, read_folder
from flightlog.readers.csv_file import GZIP
from flightlog.readers.folder import Tables
from flightlog.readers.log import Log, finish

ULOG = b"ULog\x01\x12\x35"
DATAFLASH = b"\xa3\x95"
HEAD = 65_536  # [bytes] in which a text log has told what it is
WANTED = "a flight folder, CSV (with a mapping), PX4 ULog or ArduPilot DataFlash would be right"


def read_log(path: Path | str, mapping: Path | str | None = None) -> Log:
    """The log in a file or folder; UserError names what is wrong with it and what would be right.

    Args:
        path: a flight folder, a folder of CSV files, a CSV file, a ULog, a DataFlash log (binary or text).
        mapping: what a CSV's columns are; None: the file `<log name>.mapping.toml` beside it, if any.
    """
    with np.errstate(all="ignore"):  # numbers out of broken files are anything
        return _read(Path(path), None if mapping is None else Path(mapping))


def _read(path: Path, mapping: Path | None) -> Log:
    if not path.exists():
        raise UserError(f"{path}: no such log; {WANTED}")
    if path.is_dir():
        return _folder(path, mapping)
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from None
    if not head:
        raise UserError(f"{path}: empty; {WANTED}")
    kind = _kind(head)
    if kind == "csv":
        return read_csv(path, mapping)
    if mapping is not None:
        raise UserError(f"{mapping}: a mapping belongs to a CSV file; {path} is a {kind} log, whose topics are known")
    if kind == "ULog":
        from flightlog.readers.ulog import read_ulog

        return read_ulog(path)
    if kind == "DataFlash":
        from flightlog.readers.dataflash_topics import read_dataflash

        return read_dataflash(path)
    raise UserError(f"{path}: no log that is known here; {WANTED}")


def _kind(head: bytes) -> str | None:
    """ULog, DataFlash, csv; None for what is none of them."""
    if head.startswith(ULOG):
        return "ULog"
    if head.startswith(DATAFLASH) or re.search(rb"^FMT\s*,\s*\d+\s*,\s*\d+\s*,", head, re.MULTILINE):
        return "DataFlash"
    if head.startswith((GZIP, b"\xff\xfe", b"\xfe\xff")) or b"\0" not in head.rstrip(b"\0"):
        return "csv"
    # a binary log whose beginning is lost has its messages all the same
    return "DataFlash" if head.count(DATAFLASH) >= 8 else None


def _folder(path: Path, mapping: Path | None) -> Log:
    if mapping is not None:
        raise UserError(f"{mapping}: a mapping belongs to a single CSV file; {path} is a folder")
    document = read_flight_json(path) if (path / NAME).is_file() else {}
    measured = path / "measured"
    if _holds(measured, ".parquet", ".arrows") or document:
        if not measured.is_dir():
            raise UserError(f"{path}: no measured/ in it; a flight is a folder that `helideck land` wrote")
        notes: list[str] = []
        tables = Tables(path, "measured", notes)
        return finish(path, "flight", tables, notes, tables, document)
    for folder in (path, measured):
        if folder.is_dir() and any(PATTERN.search(file.name) for file in folder.iterdir()):
            return read_folder(folder)
    raise UserError(f"{path}: neither measured/ with tables nor CSV files named by topic in it; {WANTED}")


def _holds(folder: Path, *endings: str) -> bool:
    return folder.is_dir() and any(file.suffix in endings for file in folder.iterdir())
