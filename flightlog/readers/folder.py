"""Reads a flight folder, finished or broken off."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from flightlog.errors import UserError
from flightlog.flight_json import read_flight_json
from flightlog.tables import Table, arrange
from flightlog.topics import topic_of


class Tables(Mapping[str, Table]):
    """The tables of measured/ or of truth/ by topic."""

    def __init__(self, folder: Path, group: str, notes: list[str]) -> None:
        """Read every table of the group; what is out of order goes to `notes`."""
        self._tables: dict[str, Table] = {}
        for name, path in sorted(_files(folder / group).items()):
            arrow = _read(path, notes)
            if arrow is not None:
                _check_names(path, arrow)
                table, found = arrange(arrow, topic_of(group, name), name, str(path))
                self._tables[name] = table
                notes += [f"{group}/{note}" for note in found]

    def __getitem__(self, name: str) -> Table:
        if name not in self._tables:
            raise KeyError(f"no topic {name!r}; there is {', '.join(self._tables) or 'none'}")
        return self._tables[name]

    def __contains__(self, name: object) -> bool:
        return name in self._tables

    def __iter__(self) -> Iterator[str]:
        return iter(self._tables)

    def __len__(self) -> int:
        return len(self._tables)


class Flight:
    """A flight as logged. `truth` is opened when first asked for, and cannot be where the reader was told so."""

    def __init__(self, folder: Path, document: Mapping[str, Any], *, truth: bool) -> None:
        self.folder = folder
        self.document = document
        self.notes: list[str] = []
        self.measured = Tables(folder, "measured", self.notes)
        self._may_see_truth = truth
        self._truth: Tables | None = None

    @property
    def truth(self) -> Tables:
        """What only a simulator knows."""
        if not self._may_see_truth:
            raise PermissionError(f"{self.folder}: truth/ is closed to whoever reads with truth=False")
        if self._truth is None:
            self._truth = Tables(self.folder, "truth", self.notes)
        return self._truth


def read_flight(folder: Path | str, *, truth: bool = True) -> Flight:
    """The flight in `folder`; UserError names what is missing or broken.

    Args:
        folder: where flight.json lies.
        truth: False closes truth/ to the caller for good.
    """
    folder = Path(folder)
    document = read_flight_json(folder)
    if not (folder / "measured").is_dir():
        raise UserError(f"{folder}: no measured/ in it; a flight is a folder that `helideck land` wrote")
    return Flight(folder, document, truth=truth)


def _files(directory: Path) -> dict[str, Path]:
    """Topic -> file; the finished one where both lie there."""
    files = {path.stem: path for path in directory.glob("*.arrows")}
    return files | {path.stem: path for path in directory.glob("*.parquet")}


def _check_names(path: Path, arrow: pa.Table) -> None:
    try:
        _ = arrow.column_names
    except UnicodeDecodeError:
        raise UserError(f"{path}: a column's name is no text (UTF-8): the file is broken") from None


def _read(path: Path, notes: list[str]) -> pa.Table | None:
    """The file's rows; None where a stream broke off before its first batch."""
    if path.suffix == ".arrows":
        return _read_stream(path, notes)
    try:
        return pq.read_table(path)
    except (pa.ArrowInvalid, pa.ArrowTypeError) as error:
        raise UserError(f"{path}: not a Parquet file: {str(error).splitlines()[0]}") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {str(error).splitlines()[0]}") from None


def _read_stream(path: Path, notes: list[str]) -> pa.Table | None:
    """All whole batches of a stream that may have been cut anywhere."""
    batches: list[pa.RecordBatch] = []
    schema = None
    try:
        with pa.OSFile(str(path)) as source, pa.ipc.open_stream(source) as stream:
            schema = stream.schema
            batches.extend(stream)
    except (pa.ArrowInvalid, OSError) as error:
        if schema is None and not _starts_as_stream(path):
            raise UserError(f"{path}: not an Arrow stream: {str(error).splitlines()[0]}") from None
    rows = sum(batch.num_rows for batch in batches)
    place = f"{path.parent.name}/{path.stem}"
    if not rows:
        notes.append(f"{place}: the flight was broken off before its first rows were written")
        return None
    notes.append(f"{place}: the flight was broken off; {rows} rows were written")
    return pa.Table.from_batches(batches, schema)


def _starts_as_stream(path: Path) -> bool:
    """Whether the file begins, as far as it goes, with the marker of an encapsulated Arrow message."""
    with path.open("rb") as file:
        head = file.read(4)
    return head == b"\xff\xff\xff\xff"[: len(head)]
