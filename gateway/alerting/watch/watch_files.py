"""The watch's files: a snapshot of the evaluator, and the logs of everything that it was given since.

`log-N` begins with the state that `snapshot-N` holds, so that the newest whole snapshot and the logs from its number
on give the evaluator as it was. A snapshot is written beside the new log; until it is there the ones before it count.
"""

from __future__ import annotations

import contextlib
import logging
import os
import re
import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from gateway.alerting.watch.log import LogFile, read_log

__all__ = ["Recovered", "WatchFiles"]

log = logging.getLogger(__name__)

LOG_BYTES = 96 << 20  # of one log; then it is time for a snapshot
SNAPSHOT_BYTES = 1 << 30
PIECE_BYTES = 1 << 20
MAGIC = b"MRWS\x01\n"
_HEAD = struct.Struct("<QI")
_NAME = re.compile(r"(log|snapshot)-(\d{8})")


@dataclass(frozen=True, slots=True)
class Recovered:
    """What a former run left: a snapshot's bytes, None for an evaluator that knows nothing, and the logs after it."""

    snapshot: bytes | None
    logs: tuple[Path, ...]

    def records(self) -> Iterator[tuple[int, bytes]]:
        """The records of the logs, the oldest first."""
        for path in self.logs:
            yield from read_log(path)


class WatchFiles:
    """Owns `folder`. Not thread-safe; nothing here raises OSError but `load` and `begin`."""

    def __init__(self, folder: Path, *, log_bytes: int = LOG_BYTES) -> None:
        self._folder = folder
        self._log_bytes = log_bytes
        self._log: LogFile | None = None
        self._number = 0
        self.whole = True  # False: the log lacks something, and a snapshot has to make up for it

    @property
    def logs(self) -> bool:
        """Whether what is appended is kept."""
        return self._log is not None

    @property
    def size_bytes(self) -> int:
        """How large the log is."""
        return self._log.size_bytes if self._log is not None else 0

    @property
    def full(self) -> bool:
        """Whether it is time for a snapshot."""
        return not self.whole or self.size_bytes >= self._log_bytes

    def load(self) -> Recovered:
        """What is there of former runs; what is damaged is left out, with a line in the gateway's log."""
        found = [(kind, number) for kind, number in self._found() if number < self._number]
        snapshots = sorted((number for kind, number in found if kind == "snapshot"), reverse=True)
        logs = sorted(number for kind, number in found if kind == "log")
        for number in snapshots:
            data = _read_snapshot(self._folder / _name("snapshot", number))
            if data is not None:
                return Recovered(data, self._paths(logs, number))
            log.warning("%s is damaged", self._folder / _name("snapshot", number))
        if logs and logs[0] != 1:
            log.warning("the watch begins anew: there is no whole snapshot in %s", self._folder)
            return Recovered(None, ())
        return Recovered(None, self._paths(logs, 1))

    def begin(self) -> None:
        """Open a log of this run behind those that are there."""
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        for torn in self._folder.glob("snapshot-*.new"):  # a kill -9 while it was written
            torn.unlink(missing_ok=True)
        self._number = max([self._number, *(number for _, number in self._found())]) + 1
        self._log = LogFile(self._folder / _name("log", self._number))

    def append(self, kind: int, *payloads: bytes) -> None:
        """Add records; where the disk does not take them, or the log is twice its size, it is not whole any more."""
        if not self.whole or self._log is None:
            return
        try:
            self._log.append(kind, *payloads)
        except OSError as error:
            log.warning("what the watch is given cannot be logged: %s", error)
            self.whole = False
        else:
            self.whole = self._log.size_bytes < 2 * self._log_bytes

    def rotate(self, records: Iterable[tuple[int, bytes]]) -> int:
        """Go on in a new log that begins with `records`; the number that the snapshot of this moment has to have.

        0: the disk takes none.
        """
        former = self._log
        try:
            self.begin()
        except OSError as error:
            log.warning("the watch's log cannot be begun: %s", error)
            self.whole, self._log = False, former
            return 0
        if former is not None:
            former.close()
        self.whole = True
        for kind, payload in records:
            self.append(kind, payload)
        return self._number if self.whole else 0

    def save(self, number: int, data: bytes) -> bool:
        """Write the snapshot that a `rotate` named, and remove what it makes superfluous."""
        if len(data) > SNAPSHOT_BYTES:
            log.error("the watch's snapshot is not written: it has %d bytes of %d", len(data), SNAPSHOT_BYTES)
            return False
        path = self._folder / _name("snapshot", number)
        try:
            _write_whole(path, data)
        except OSError as error:
            log.warning("the watch's snapshot cannot be written: %s", error)
            with contextlib.suppress(OSError):
                path.with_suffix(".new").unlink()
            return False
        self._remove_before(number)
        return True

    def close(self) -> None:
        """Close the log."""
        if self._log is not None:
            self._log.close()
            self._log = None

    def _found(self) -> list[tuple[str, int]]:
        try:
            names = [_NAME.fullmatch(path.name) for path in self._folder.iterdir()]
        except OSError as error:
            log.warning("what the watch has kept cannot be seen: %s", error)
            return []
        return [(name[1], int(name[2])) for name in names if name is not None]

    def _paths(self, logs: Iterable[int], first: int) -> tuple[Path, ...]:
        return tuple(self._folder / _name("log", number) for number in logs if number >= first)

    def _remove_before(self, number: int) -> None:
        for kind, found in self._found():
            if found < number:
                with contextlib.suppress(OSError):
                    (self._folder / _name(kind, found)).unlink()


def _name(kind: str, number: int) -> str:
    return f"{kind}-{number:08}"


def _write_whole(path: Path, data: bytes) -> None:
    new = path.with_suffix(".new")
    with open(new, "wb", opener=_private) as file:
        file.write(MAGIC + _HEAD.pack(len(data), zlib.crc32(data)))
        view = memoryview(data)
        for start in range(0, len(view), PIECE_BYTES):
            file.write(view[start : start + PIECE_BYTES])
        file.flush()
        os.fsync(file.fileno())
    new.replace(path)


def _private(path: str, flags: int) -> int:
    return os.open(path, flags, 0o600)


def _read_snapshot(path: Path) -> bytes | None:
    try:
        with path.open("rb") as file:
            head = file.read(len(MAGIC) + _HEAD.size)
            if len(head) != len(MAGIC) + _HEAD.size or not head.startswith(MAGIC):
                return None
            length, check = _HEAD.unpack_from(head, len(MAGIC))
            data = file.read(length) if length <= SNAPSHOT_BYTES else b""
    except OSError:
        return None
    return data if len(data) == length and zlib.crc32(data) == check else None
