"""Writes a flight down while it flies, so that a killed flight is readable to its last second.

Each topic is an Arrow IPC stream of record batches; at the end it becomes a Parquet file and the stream goes.
"""

import contextlib
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from flightlog.errors import UserError
from flightlog.flight_json import write_flight
from flightlog.signals import Frame
from flightlog.topics import Column, columns_of

__all__ = ["Recorder", "TopicWriter", "write_flight"]

BLOCK = 512  # [rows] a record batch has at most

_TYPES = {"float": pa.float64(), "int": pa.int64(), "bool": pa.bool_(), "text": pa.string()}
_NUMPY = {"float": np.float64, "int": np.int64, "bool": np.bool_}


class TopicWriter:
    """Takes the rows of one topic."""

    def __init__(self, path: Path, columns: Sequence[Column]) -> None:
        """`path`: the stream's file, made with the first row."""
        self.path = path
        self.columns = tuple(columns)
        self.schema = pa.schema(
            [pa.field(c.name, _TYPES[c.kind], metadata={"unit": c.unit} if c.unit else None) for c in columns]
        )
        self._rows: list[Sequence[Any]] = []
        self._file: Any = None  # pa.OSFile and the stream into it, once there are rows
        self._stream: Any = None
        self._size = 0  # [bytes] of the stream that hold whole batches
        self._last = float("nan")  # t of the last row that is safe
        self._failed = False

    def append(self, row: Sequence[Any]) -> None:
        """Add a row: values in the order of the columns (a sample's NamedTuple as it is)."""
        rows = self._rows
        rows.append(row)
        if len(rows) >= BLOCK:
            self.flush()

    def flush(self) -> None:
        """Write the rows so far to the file."""
        if not self._rows or self._failed:
            return
        rows, self._rows = self._rows, []
        batch = self._batch(rows)
        try:
            if self._stream is None:
                self._file = pa.OSFile(str(self.path), "wb")
                self._stream = pa.ipc.new_stream(self._file, self.schema)
            self._stream.write_batch(batch)
            self._size = self._file.tell()
        except OSError as error:
            self._give_up()
            raise UserError(
                f"{self.path}: cannot be written: {_reason(error)}; what was written up to t = {self._last:.1f} s "
                "stays readable"
            ) from None
        self._last = float(rows[-1][0])

    def close(self) -> None:
        """Write what is left and turn the stream into Parquet, whole or not at all."""
        self.flush()
        if self._stream is None or self._failed:
            return
        self._stream.close()
        self._file.close()
        self._stream = self._file = None
        target = self.path.with_suffix(".parquet")
        draft = self.path.with_suffix(".parquet.part")
        try:
            with pa.OSFile(str(self.path)) as source:
                table = pa.ipc.open_stream(source).read_all()
            pq.write_table(table, draft, compression="zstd")
            os.replace(draft, target)
        except OSError as error:
            with contextlib.suppress(OSError):
                draft.unlink()
            raise UserError(f"{target}: cannot be written: {_reason(error)}; {self.path.name} holds the rows") from None
        self.path.unlink()

    def _batch(self, rows: list[Sequence[Any]]) -> pa.RecordBatch:
        widths = {len(row) for row in rows}
        if widths != {len(self.columns)}:
            names = ", ".join(c.name for c in self.columns)
            raise ValueError(f"{self.path.stem}: rows of {sorted(widths)} values; the columns are {names}")
        arrays = []
        for column, values in zip(self.columns, zip(*rows, strict=True), strict=True):
            if column.kind == "text":
                arrays.append(pa.array(values, pa.string()))
            else:
                arrays.append(pa.array(np.fromiter(values, _NUMPY[column.kind], len(rows))))
        return pa.RecordBatch.from_arrays(arrays, schema=self.schema)

    def _give_up(self) -> None:
        """Leave a stream of whole batches behind: no half batch, and nothing more to it."""
        self._failed = True
        with contextlib.suppress(OSError):
            if self._stream is not None:
                self._stream.close()
        with contextlib.suppress(OSError):
            if self._file is not None:
                self._file.close()
        with contextlib.suppress(OSError):
            if self.path.exists():
                os.truncate(self.path, self._size)
                if self._size == 0:
                    self.path.unlink()
        self._stream = self._file = None


class Recorder:
    """The flight folder while the flight lasts; a context manager that closes it whatever happens."""

    def __init__(self, folder: Path) -> None:
        """Make the folder; UserError where it has something in it or cannot be made."""
        self.folder = Path(folder)
        if self.folder.exists() and not self.folder.is_dir():
            raise UserError(f"{self.folder}: a file is in the way; name a folder that is new or empty")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if any(self.folder.iterdir()):
                raise UserError(f"{self.folder}: not empty; name a folder that is new or empty")
            # fails for the second of two flights that want the same empty folder
            (self.folder / "measured").mkdir()
        except FileExistsError:
            raise UserError(f"{self.folder}: in use by another flight; name a folder that is new or empty") from None
        except OSError as error:
            raise UserError(f"{self.folder}: cannot be made: {_reason(error)}") from None
        self._writers: dict[tuple[str, str], TopicWriter] = {}
        self._pictures: dict[str, int] = {}

    def topic(self, group: str, name: str, columns: Iterable[str | Column] | None = None) -> TopicWriter:
        """The writer of a topic; its file is made with the first row.

        Args:
            group: "measured" or "truth".
            name: the topic, such as "imu", or "gps_2" for a second one.
            columns: names of the topic's known columns, or Columns of one's own; t first. None: all that
                Helideck writes.
        """
        writer = self._writers.get((group, name))
        if writer is None:
            directory = self.folder / group
            directory.mkdir(exist_ok=True)
            writer = TopicWriter(directory / f"{name}.arrows", columns_of(group, name, columns))
            self._writers[group, name] = writer
        return writer

    def frame(self, frame: Frame) -> None:
        """Keep a picture without loss, so that vision can run on it again."""
        import cv2

        number = self._pictures.get(frame.camera, 0)
        self._pictures[frame.camera] = number + 1
        file = Path("frames") / f"{frame.camera}-{number:06d}.png"
        path = self.folder / "measured" / file
        path.parent.mkdir(exist_ok=True)
        image = frame.image if frame.image.ndim == 2 else cv2.cvtColor(frame.image, cv2.COLOR_RGB2BGR)
        # level 1 packs a noisy picture as well as level 9 does, in a tenth of the time
        _, png = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        try:
            path.write_bytes(png.tobytes())
        except OSError as error:
            with contextlib.suppress(OSError):
                path.unlink()
            raise UserError(f"{path}: cannot be written: {_reason(error)}") from None
        self.topic("measured", "frames").append((frame.t, frame.t_arrival, frame.camera, file.as_posix()))

    def flush(self) -> None:
        """Write what was appended so far: call it about once per simulated second."""
        for writer in self._writers.values():
            writer.flush()

    def close(self) -> None:
        """Turn all streams into Parquet; a topic that cannot be closed does not keep the others from it."""
        failures = []
        for writer in self._writers.values():
            try:
                writer.close()
            except UserError as error:
                failures.append(error)
        self._writers.clear()
        if failures:
            raise failures[0]

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
            return
        # what ended the flight is the news: a failure to close must not hide it
        with contextlib.suppress(UserError):
            self.close()


def _reason(error: OSError) -> str:
    return os.strerror(error.errno) if error.errno else str(error)
