"""CSV: the topics as a folder of files, one topic, all of them below each other, or side by side under other names.

    folder/imu.csv.gz           t,fx,fy,fz,...                 one file a topic
    imu.csv                     t,fx,fy,fz,...                 one topic alone
    log.csv                     t,topic,column,value           narrow: a row a number
    log.csv                     t,imu.fx,imu.fy,baro.altitude  wide, by our names
    log.csv                     anything, with a mapping       wide, by others' names
"""

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from flightlog import toml_file
from flightlog.errors import UserError
from flightlog.readers.csv_file import read_columns
from flightlog.readers.log import Draft, Log
from flightlog.readers.mapping import SUFFIX, MappingFile, convert, read_mapping, turn_quaternions
from flightlog.topics import MEASURED, topic_of
from flightlog.units import to_si

Floats = NDArray[np.float64]

PATTERN = re.compile(r"\.csv(\.gz)?$", re.IGNORECASE)


def read_folder(folder: Path) -> Log:
    """One file a topic, `<topic>.csv` or `<topic>.csv.gz`."""
    draft = Draft(folder, "csv")
    for path in sorted(file for file in folder.iterdir() if PATTERN.search(file.name) and file.is_file()):
        name = PATTERN.sub("", path.name)
        columns = read_columns(path, draft)
        if topic_of("measured", name) is None:
            draft.note(f"{path.name}: left out, {name!r} is no topic; {toml_file.nearest(name, MEASURED)}")
        else:
            draft.take(name, _arrow(columns), file=str(path))
    return draft.finish()


def read_csv(path: Path, mapping: Path | None = None) -> Log:
    """A single file; `mapping` None: the one beside it, if any."""
    mapping = mapping or beside(path)
    draft = Draft(path, "csv")
    columns = read_columns(path, draft)
    if mapping is not None:
        _map(columns, read_mapping(mapping), draft, mapping)
    elif {"t", "topic", "column", "value"} <= columns.keys():
        _narrow(columns, draft)
    elif "t" in columns and all(_known(name) for name in columns if name != "t"):
        _wide(columns, draft)
    elif "t" in columns and topic_of("measured", PATTERN.sub("", path.name)) is not None:
        draft.take(PATTERN.sub("", path.name), _arrow(columns))
    else:
        raise UserError(
            f"{path}: what its columns are is not known: {_list(columns)}; name them as topic.column with t, or give "
            f"a mapping by --mapping FILE or as {path.name}{SUFFIX} beside it"
        )
    return draft.finish()


def beside(path: Path) -> Path | None:
    """The mapping that lies beside a log, by its name with or without the endings."""
    for name in (path.name, path.name.removesuffix(".gz"), PATTERN.sub("", path.name)):
        found = path.with_name(name + SUFFIX)
        if found.is_file():
            return found
    return None


def _list(columns: dict[str, Floats] | list[str]) -> str:
    names = list(columns)
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")


def _known(name: str) -> bool:
    topic, dot, column = name.partition(".")
    return bool(dot) and bool(column) and topic_of("measured", topic) is not None



def _map(columns: dict[str, NDArray], mapping: MappingFile, draft: Draft, file: Path) -> None:  # type: ignore[type-arg]
    t, shared = _time(columns, mapping, draft, file)
    topics: dict[str, dict[str, Floats]] = {}
    units: dict[str, dict[str, str]] = {}
    for source, target in mapping.columns.items():
        values = columns.get(source)
        if values is None:
            wanted = toml_file.nearest(source, columns)
            draft.note(f"{file.name}: the log has no column {source!r}; {wanted}")
            continue
        if values.dtype.kind != "f":
            raise UserError(f"{draft.path}: column {source!r} holds text; numbers would be right for {target.to}")
        topic, column, si, unit = convert(values, target, mapping.frames)
        topics.setdefault(topic, {"t": t})[column] = si
        units.setdefault(topic, {})[column] = unit
    if not topics:
        raise UserError(f"{draft.path}: none of the columns in {file} is there; it has {_list(columns)}")
    for topic, found in topics.items():
        turn_quaternions(found, mapping.frames)
        # rows in which the topic says nothing are another topic's
        said = np.any([np.isfinite(values) for name, values in found.items() if name != "t"], axis=0)
        kept = {name: values[said] for name, values in found.items()}
        draft.add(topic, kept, timed=shared, units=units[topic])


def _time(columns: dict[str, NDArray], mapping: MappingFile, draft: Draft, file: Path) -> tuple[Floats, bool]:  # type: ignore[type-arg]
    clock = mapping.time
    if clock.step is not None:
        return clock.step * np.arange(len(next(iter(columns.values()))), dtype=float), True
    assert clock.column is not None
    values = columns.get(clock.column)
    if values is None:
        wanted = toml_file.nearest(clock.column, columns)
        raise UserError(f"{file}: time.column: the log {draft.path} has no column {clock.column!r}; {wanted}")
    if values.dtype.kind != "f":
        raise UserError(f"{draft.path}: column {clock.column!r} holds text; a time as a number would be right")
    return to_si(values, clock.unit, "s"), True


def _narrow(columns: dict[str, NDArray], draft: Draft) -> None:  # type: ignore[type-arg]
    """Rows of t, topic, column, value; rows of one topic and time are one."""
    t, values = columns["t"], columns["value"]
    if t.dtype.kind != "f" or values.dtype.kind != "f":
        raise UserError(f"{draft.path}: columns t and value hold text; numbers would be right")
    topics, names = columns["topic"].astype(str), columns["column"].astype(str)
    for topic in dict.fromkeys(topics.tolist()):
        if topic_of("measured", topic) is None:
            rows = int(np.count_nonzero(topics == topic))
            draft.note(f"{rows} rows of {topic!r} left out, which is no topic; {toml_file.nearest(topic, MEASURED)}")
            continue
        own = topics == topic
        places = _row_numbers(t[own], names[own])
        found = {"t": np.full(places[-1] + 1, np.nan)}
        found["t"][places] = t[own]
        for name in dict.fromkeys(names[own].tolist()):
            if name in ("", "t"):
                raise UserError(f"{draft.path}: a row of {topic} has the column {name!r}; which names nothing")
            found[name] = np.full(places[-1] + 1, np.nan)
            found[name][places[names[own] == name]] = values[own][names[own] == name]
        draft.add(topic, found)


def _row_numbers(t: Floats, names: NDArray) -> NDArray[np.int64]:  # type: ignore[type-arg]
    """To which row each number belongs: a new one begins where the time changes or a column comes again."""
    rows = np.zeros(len(t), np.int64)
    seen: set[str] = set()
    row = 0
    for index, name in enumerate(names.tolist()):
        if index and (t[index] != t[index - 1] or name in seen):
            row += 1
            seen.clear()
        seen.add(name)
        rows[index] = row
    return rows


def _wide(columns: dict[str, NDArray], draft: Draft) -> None:  # type: ignore[type-arg]
    """Columns topic.column beside one t."""
    t = columns["t"]
    if t.dtype.kind != "f":
        raise UserError(f"{draft.path}: column t holds text; seconds as a number would be right")
    topics: dict[str, dict[str, NDArray]] = {}  # type: ignore[type-arg]
    for name, values in columns.items():
        topic, _, column = name.partition(".")
        if column:
            topics.setdefault(topic, {})[column] = values
    for topic, found in topics.items():
        own = found.get("t", t)  # a topic may have brought its own
        numbers = [np.isfinite(v) if v.dtype.kind == "f" else v != "" for name, v in found.items() if name != "t"]
        said = np.any(numbers, axis=0) if numbers else np.zeros(len(own), bool)
        if said.any():
            draft.take(topic, _arrow({"t": own[said], **{n: v[said] for n, v in found.items() if n != "t"}}))


def _arrow(columns: dict[str, NDArray]) -> pa.Table:  # type: ignore[type-arg]
    """Columns as an Arrow table."""
    return pa.table({name: pa.array(values.tolist() if values.dtype.kind == "O" else values)
                     for name, values in columns.items()})  # fmt: skip
