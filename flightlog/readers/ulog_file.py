"""A ULog's messages by name and instance, as pyulog parses them."""

import contextlib
import io
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightlog.errors import UserError
from flightlog.readers.log import Draft

Floats = NDArray[np.float64]

_HUGE = re.compile(rb"\[[0-9]{6,}\]")  # no message has arrays of that length: the definition is broken


class Dataset:
    """One message's columns, one instance."""

    def __init__(self, data: dict[str, Any]) -> None:
        self._data = data
        self.t = self.stamps("timestamp")

    def __contains__(self, name: str) -> bool:
        return name in self._data

    def __getitem__(self, name: str) -> Floats:
        return np.asarray(self._data[name], float)

    def first(self, *names: str) -> Floats | None:
        """The first of these columns that there is."""
        return next((self[name] for name in names if name in self), None)

    def stamps(self, name: str) -> Floats:
        """A column of microseconds [s]."""
        return np.asarray(self._data[name]).astype(float) * 1e-6

    @property
    def valid_time(self) -> Floats:
        """When the sample was taken [s]: beside the time of the message in newer firmware."""
        if "timestamp_sample" not in self:
            return self.t
        sample = self.stamps("timestamp_sample")
        return np.where(sample > 0.0, sample, self.t)

    def vector(self, name: str, size: int = 3) -> list[Floats] | None:
        """The elements of an array."""
        return [self[f"{name}[{i}]"] for i in range(size)] if all(f"{name}[{i}]" in self for i in range(size)) else None


class _Bounded(io.BytesIO):
    """A file that notices when its reader goes round in circles, as the parser does at some broken messages."""

    MOST = 16  # returns to one place

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self._visits: Counter[int] = Counter()

    def seek(self, offset: int, whence: int = 0, /) -> int:
        place = super().seek(offset, whence)
        self._visits[place] += 1
        if self._visits[place] > self.MOST:
            raise EOFError(f"no message can be read beyond byte {place}")
        return place


class Source:
    """All messages by name and instance."""

    def __init__(self, path: Path, draft: Draft) -> None:
        self.draft = draft
        self._found: dict[str, list[Dataset]] = {}
        datasets, self.parameters = _parse(path, draft)
        for dataset in datasets:
            if "timestamp" in dataset.data and len(dataset.data["timestamp"]):
                self._found.setdefault(dataset.name, []).append(Dataset(dataset.data))

    def all(self, *names: str) -> list[Dataset]:
        """Every instance of the first of these messages that there is."""
        return next((self._found[name] for name in names if name in self._found), [])

    def one(self, *names: str) -> Dataset | None:
        """The first instance."""
        return next(iter(self.all(*names)), None)


def _parse(path: Path, draft: Draft) -> tuple[list[Any], dict[str, Any]]:
    """(pyulog's data sets, parameters at the start)."""
    from pyulog import ULog

    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from None
    if huge := _HUGE.search(data):
        found = f"byte {huge.start()} declares an array of {huge[0].decode()} elements"
        raise UserError(f"{path}: not a sound ULog: {found}")
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), np.errstate(all="ignore"):
            log = ULog(_Bounded(data), None, True)
    except MemoryError:
        raise
    except Exception as error:  # whatever a broken file makes of the parser, the file is the reason
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UserError(f"{path}: not a sound ULog: {reason}") from None
    if log.file_corruption:
        draft.note(f"{path.name}: broken in places or broken off; what could be read is used")
    if log.dropouts:
        lost = sum(dropout.duration for dropout in log.dropouts) / 1000.0
        draft.note(f"{path.name}: {len(log.dropouts)} dropout(s) of the logger, {lost:.2f} s in all")
    return list(log.data_list), dict(log.initial_parameters)
