"""Writes logs as others' firmware does: a ULog and a binary DataFlash, small but whole."""

import struct

import numpy as np

# --- PX4 ULog ---------------------------------------------------------------------------------------------------------

ULOG_TYPES = {"uint64_t": "Q", "uint32_t": "I", "uint16_t": "H", "uint8_t": "B", "int32_t": "i", "float": "f",
              "double": "d", "bool": "?"}  # fmt: skip


def ulog(topics, parameters=None):
    """A ULog's bytes.

    topics: (name, instance) -> {field: (type, values)}, the first field `timestamp` in microseconds; `field[3]` as a
    name makes an array of the values (N, 3), `field[3].part` an array of messages with that one field.
    """

    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    out = [b"ULog\x01\x12\x35\x01", struct.pack("<Q", 0), message("B", bytes(40))]
    formats = {}
    for (name, _), fields in topics.items():
        declared = []
        for field, (kind, _) in fields.items():
            base, _, size = field.partition("[")
            size, _, part = size.partition(".")
            if part:
                formats[f"{base}_report"] = f"{base}_report:{kind} {part};"
                kind = f"{base}_report"
            declared.append(f"{kind}[{size} {base}" if size else f"{kind} {field}")
        formats[name] = f"{name}:{';'.join(declared)};"
    out += [message("F", text.encode()) for text in formats.values()]
    for name, value in (parameters or {}).items():
        key = f"float {name}".encode()
        out.append(message("P", bytes([len(key)]) + key + struct.pack("<f", value)))
    rows = []
    for number, ((name, instance), fields) in enumerate(topics.items()):
        out.append(message("A", struct.pack("<BH", instance, number) + name.encode()))
        packing = "<H"
        columns = [np.full(len(next(iter(fields.values()))[1]), number)]
        for kind, values in fields.values():
            values = np.asarray(values, float if kind in ("float", "double") else np.int64)
            wide = values.reshape(len(values), -1)
            packing += ULOG_TYPES[kind] * wide.shape[1]
            columns += list(wide.T)
        for stamp, *values in zip(columns[1], *columns, strict=True):
            cells = [v.item() if hasattr(v, "item") else v for v in values]
            rows.append((int(stamp), message("D", struct.pack(packing, *cells))))
    rows.sort(key=lambda row: row[0])
    return b"".join(out) + b"".join(body for _, body in rows)


# --- ArduPilot DataFlash ----------------------------------------------------------------------------------------------

DATAFLASH_TYPES = {"b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d", "Q": "Q",
                   "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "n": "4s", "N": "16s", "Z": "64s"}  # fmt: skip


def dataflash(formats, rows):
    """A binary log's bytes. formats: name -> (format, columns); rows: (name, raw values) in the file's order."""
    numbers = {name: 200 + i for i, name in enumerate(formats)}
    out = [_fmt(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")]
    packings = {}
    for name, (form, columns) in formats.items():
        packings[name] = "<" + "".join(DATAFLASH_TYPES[c] for c in form)
        out.append(_fmt(numbers[name], struct.calcsize(packings[name]) + 3, name, form, columns))
    for name, values in rows:
        cells = [value.encode() if isinstance(value, str) else value for value in values]
        out.append(b"\xa3\x95" + bytes([numbers[name]]) + struct.pack(packings[name], *cells))
    return b"".join(out)


def _fmt(kind, length, name, form, columns):
    texts = struct.pack("<4s16s64s", name.encode(), form.encode(), columns.encode())
    return b"\xa3\x95\x80" + bytes([kind, length]) + texts
