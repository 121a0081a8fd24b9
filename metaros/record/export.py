"""Recordings as what other programs read: JSON lines, CSV tables, picture files."""

from __future__ import annotations

import csv
import json
import re
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, TextIO

import numpy as np

from metaros.errors import FieldError, RecordingError
from metaros.idl.json import to_json
from metaros.record.bag import BagMessage
from metaros.sanitize import sanitize_json

__all__ = ["export_csv", "export_images", "export_json", "png"]

_IMAGE: Final = "sensor_msgs/msg/Image"
_COMPRESSED: Final = "sensor_msgs/msg/CompressedImage"
_MAGIC: Final = ((b"\xff\xd8", "jpg"), (b"\x89PNG", "png"), (b"RIFF", "webp"))
_ENCODINGS: Final = {  # channels, bytes each, order for PNG
    "mono8": (1, 1, None),
    "8UC1": (1, 1, None),
    "mono16": (1, 2, None),
    "16UC1": (1, 2, None),
    "rgb8": (3, 1, None),
    "bgr8": (3, 1, [2, 1, 0]),
    "8UC3": (3, 1, [2, 1, 0]),
    "rgba8": (4, 1, None),
    "bgra8": (4, 1, [2, 1, 0, 3]),
}
_COLOUR: Final = {1: 0, 3: 2, 4: 6}  # PNG's colour types
_ODD: Final = re.compile(r"[^A-Za-z0-9_~-]")
_NAME_CHARS: Final = 160  # of a file's name; systems take 255 bytes
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")
_TABLES: Final = 200  # CSV files that are open at a time: one a topic


def export_json(messages: Iterable[BagMessage], output: TextIO) -> int:
    """One JSON object a line: topic, type, stamps in nanoseconds, sequence, message; returns how many."""
    count = 0
    for message in messages:
        count += 1
        line = {
            "topic": message.topic.name,
            "type": message.topic.type_name,
            "log_ns": message.log_ns,
            "publish_ns": message.publish_ns,
            "sequence": message.sequence,
            "message": to_json(message.decode()),
        }
        output.write(sanitize_json(json.dumps(line, ensure_ascii=False)) + "\n")
    return count


def export_csv(messages: Iterable[BagMessage], folder: Path, *, fields: Sequence[str] = ()) -> dict[Path, int]:
    """One table a topic: `log_ns`, `publish_ns`, and a column a field; returns the files with their rows.

    Without `fields` every field has a column; arrays are JSON in one cell. A text that begins like a formula has a `'`
    before it. FieldError for a field that is not there.
    """
    rows: dict[Path, int] = {}
    with ExitStack() as stack:
        writers: dict[Path, tuple[Any, list[str]]] = {}
        for message in messages:
            path = folder / f"{_file_name(message)}.csv"
            values = dict(_flat(to_json(message.decode())))
            if path not in writers:
                if len(writers) >= _TABLES:
                    raise RecordingError(f"a table a topic makes more than {_TABLES} files: choose topics")
                columns = list(fields) or list(values)
                folder.mkdir(parents=True, exist_ok=True)
                writer = csv.writer(stack.enter_context(path.open("x", newline="", encoding="utf-8")))
                writer.writerow(["log_ns", "publish_ns", *columns])
                writers[path] = writer, columns
            writer, columns = writers[path]
            if missing := [name for name in columns if name not in values]:
                raise FieldError(f"{message.topic.name} has no field {missing[0]!r}")
            writer.writerow([message.log_ns, message.publish_ns, *(_cell(values[name]) for name in columns)])
            rows[path] = rows.get(path, 0) + 1
    return rows


def export_images(messages: Iterable[BagMessage], folder: Path) -> dict[Path, int]:
    """Each image as a file `<topic>/<log_ns>.png`, compressed ones as they are; returns the folders with their counts.

    Messages of other types are passed over. RecordingError for an encoding that is not a plain picture.
    """
    counts: dict[Path, int] = {}
    for message in messages:
        if message.topic.type_name not in (_IMAGE, _COMPRESSED):
            continue
        value = message.decode()
        data, suffix = _picture(value) if message.topic.type_name == _COMPRESSED else (_as_png(message, value), "png")
        place = folder / _file_name(message)
        place.mkdir(parents=True, exist_ok=True)
        (place / f"{message.log_ns}.{suffix}").write_bytes(data)
        counts[place] = counts.get(place, 0) + 1
    return counts


def png(pixels: Any) -> bytes:
    """A PNG file of rows × columns (grey) or rows × columns × 3 or 4, of uint8 or uint16."""
    height, width = pixels.shape[:2]
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    depth = pixels.dtype.itemsize * 8
    rows = np.ascontiguousarray(pixels.astype(pixels.dtype.newbyteorder(">"))).reshape(height, -1).view(np.uint8)
    filtered = np.hstack([np.zeros((height, 1), np.uint8), rows])
    head = struct.pack(">IIBBBBB", width, height, depth, _COLOUR[channels], 0, 0, 0)
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(filtered.tobytes(), 3)), (b"IEND", b""))
    body = b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in parts
    )
    return b"\x89PNG\r\n\x1a\n" + body


def _as_png(message: BagMessage, image: Any) -> bytes:
    if image.encoding not in _ENCODINGS:
        known = ", ".join(_ENCODINGS)
        raise RecordingError(f"{message.topic.name}: {image.encoding!r} is no plain picture: one of {known}")
    channels, size, order = _ENCODINGS[image.encoding]
    row_bytes = image.width * channels * size
    data = np.frombuffer(bytes(image.data), np.uint8)
    if image.step < row_bytes or len(data) < image.step * image.height:
        raise RecordingError(f"{message.topic.name}: an image of {len(data)} bytes is smaller than it says")
    rows = data[: image.step * image.height].reshape(image.height, image.step)[:, :row_bytes]
    kind = np.dtype(np.uint8) if size == 1 else np.dtype(np.uint16).newbyteorder(">" if image.is_bigendian else "<")
    pixels = np.ascontiguousarray(rows).view(kind).reshape(image.height, image.width, channels)
    pixels = pixels[:, :, order] if order else pixels
    return png(pixels[:, :, 0] if channels == 1 else pixels)


def _picture(image: Any) -> tuple[bytes, str]:
    data = bytes(image.data)
    return data, next((suffix for magic, suffix in _MAGIC if data.startswith(magic)), "bin")


def _file_name(message: BagMessage) -> str:
    """The topic as one plain part of a path; a recording may be from anybody, and say `/..` for a topic."""
    parts = message.topic.name.strip("/").split("/")
    name = ".".join(_ODD.sub(_percent, part) for part in parts) or "root"
    if len(name) > _NAME_CHARS:
        name = f"{name[:_NAME_CHARS]}%{zlib.crc32(name.encode()):08x}"
    return name


def _percent(found: re.Match[str]) -> str:
    return "".join(f"%{byte:02x}" for byte in found[0].encode(errors="surrogatepass"))


def _cell(value: Any) -> Any:
    """A value as a table takes it: a text that a spreadsheet would take for a formula is quoted, numbers are not."""
    if not isinstance(value, str) or not value.startswith(_FORMULA):
        return value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value


def _flat(value: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, item in value.items():
        if isinstance(item, Mapping):
            yield from _flat(item, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", json.dumps(item) if isinstance(item, list) else item
