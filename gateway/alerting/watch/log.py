"""An append-only file of records, each with its length and checksum. What a kill -9 tears off is left out on reading.

Nothing is synced: a killed process loses nothing of what it wrote, and after a loss of power the evaluator has missed
the last rows, which costs a little of what it had learned and nothing else.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

__all__ = ["LogFile", "read_log"]

MAGIC = b"MRWL\x01\n"
_HEAD = struct.Struct("<IIB")  # length of the payload, checksum of kind and payload, kind
MAX_RECORD_BYTES = 64 << 20
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | getattr(os, "O_BINARY", 0)


class LogFile:
    """One file, open for appending; OSError where the disk does not take it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = os.open(path, _NEW, 0o600)
        self.size_bytes = 0
        try:
            self._write(MAGIC)
        except OSError:
            os.close(self._file)
            path.unlink(missing_ok=True)
            raise

    def append(self, kind: int, *payloads: bytes) -> None:
        """Add records, in one write; OSError: they are not there, or the last ones are missing or torn."""
        records, begin = [], zlib.crc32(bytes((kind,)))
        for payload in payloads:
            if len(payload) > MAX_RECORD_BYTES:
                raise OSError(f"{self.path}: a record of {len(payload)} bytes, at most {MAX_RECORD_BYTES} are read")
            records += [_HEAD.pack(len(payload), zlib.crc32(payload, begin), kind), payload]
        self._write(b"".join(records))

    def close(self) -> None:
        """Close the file; what was written stays."""
        os.close(self._file)

    def _write(self, data: bytes) -> None:
        written = os.write(self._file, data)
        self.size_bytes += written
        if written != len(data):
            raise OSError(f"{self.path}: only {written} of {len(data)} bytes were written")


def read_log(path: Path) -> Iterator[tuple[int, bytes]]:
    """The records (kind, payload) up to the first that is torn or damaged; nothing of a file that is no log."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            length, check, kind = _HEAD.unpack(head)
            if length > MAX_RECORD_BYTES:
                return
            payload = file.read(length)
            if len(payload) != length or zlib.crc32(payload, zlib.crc32(bytes((kind,)))) != check:
                return
            yield kind, payload
