"""Which commands were executed: their ids are kept, across restarts, so that none is ever carried out twice.

An id is on disk before its command runs. The newest `remembered` are kept, a day's at one every four seconds; by number
and not by time, as a robot's clock may be years off. The file is append-only lines with a CRC each, and is written anew
once most of it is forgotten.
"""

from __future__ import annotations

import asyncio
import logging
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from edge_agent.errors import DiskError
from edge_agent.outbox import Disk
from metaros.limits import LIMITS

__all__ = ["CommandLog", "LogJob"]

LOG = logging.getLogger("metaros.agent.commands")
_NAME = "commands.log"
_ID_BYTES = 64
_LINE_BYTES = 8 + 1 + 2 * _ID_BYTES + 1


@dataclass(frozen=True, slots=True)
class LogJob:
    """Lines on their way to the disk; `offset` 0 puts a new file in the place of the old one."""

    disk: Disk
    offset: int
    data: bytes
    count: int

    def run(self) -> None:
        """Raises DiskError and leaves nothing behind."""
        if self.offset:
            self.disk.append(_NAME, self.offset, self.data)
        else:
            self.disk.replace(_NAME, self.data)


class CommandLog:
    """The ids, oldest first. The event loop owns it; what blocks is a job."""

    def __init__(self, disk: Disk, *, remembered: int = LIMITS.commands_remembered) -> None:
        """Raises DiskError."""
        self._disk = disk
        self._remembered = remembered
        self._size = 0  # up to the end of the last whole line
        self._ids = dict.fromkeys(self._read())
        self._new: list[bytes] = []
        self._waiting: list[asyncio.Future[None]] = []
        self._asked = False
        self._writing: asyncio.Task[None] | None = None
        self._trouble = ""
        self._forget()

    def __len__(self) -> int:
        return len(self._ids)

    def first_time(self, command_id: bytes) -> bool:
        """Whether this id is new; it is known from now on, and on disk once the next job is `written`."""
        key = command_id if len(command_id) <= _ID_BYTES else command_id[:_ID_BYTES]
        if key in self._ids:
            return False
        self._ids[key] = None
        self._new.append(key)
        self._forget()
        return True

    def knows(self, command_id: bytes) -> bool:
        """Whether the id was noted before."""
        return command_id[:_ID_BYTES] in self._ids

    def on_disk(self, command_id: bytes) -> bool:
        """Whether the id would be known after a restart."""
        return self.knows(command_id) and command_id[:_ID_BYTES] not in self._new

    def job(self) -> LogJob | None:
        """The job that writes what is new; None when nothing is."""
        if not self._new:
            return None
        anew = not self._size or self._size > 2 * _LINE_BYTES * self._remembered
        data = b"".join(map(line, self._ids if anew else self._new))
        return LogJob(self._disk, 0 if anew else self._size, data, len(self._new))

    def written(self, job: LogJob) -> None:
        """It was run."""
        self._size = job.offset + len(job.data)
        del self._new[: job.count]

    async def keep(self) -> None:
        """Until the ids that are known by now are on disk; where it refuses that is said, and they live in memory."""
        turn = asyncio.get_running_loop().create_future()
        self._waiting.append(turn)
        self.wake()
        await turn

    def wake(self) -> None:
        """Write what is new, soon."""
        self._asked = True
        if self._writing is None:
            self._writing = asyncio.create_task(self._write())

    async def close(self) -> None:
        """Write what is new, last."""
        await self.keep()

    async def _write(self) -> None:
        """Write for all who asked, in turns, until nobody does."""
        while self._asked:
            self._asked = False
            waiting, self._waiting = self._waiting, []
            if (job := self.job()) is not None:
                try:
                    await asyncio.to_thread(job.run)
                except DiskError as error:
                    self._say(f"cannot keep the ids of executed commands: {error}; they are forgotten at a restart")
                else:
                    self.written(job)
                    self._say("")
            for turn in waiting:  # in the order of their commands
                if not turn.done():
                    turn.set_result(None)
        self._writing = None

    def _say(self, trouble: str) -> None:
        if trouble and trouble != self._trouble:
            LOG.warning("%s", trouble)
        self._trouble = trouble

    def _forget(self) -> None:
        while len(self._ids) > self._remembered:
            del self._ids[next(iter(self._ids))]

    def _read(self) -> Iterator[bytes]:
        size = min(self._disk.size(_NAME), 4 * _LINE_BYTES * self._remembered)
        data = self._disk.read(_NAME, 0, size) if size else b""
        self._size = data.rfind(b"\n") + 1
        for text in data[: self._size].splitlines():
            crc, _, body = text.partition(b" ")
            try:
                if int(crc, 16) == zlib.crc32(body):
                    yield bytes.fromhex(body.decode())
            except ValueError:
                continue


def line(key: bytes) -> bytes:
    """One line: the CRC of the rest, the id."""
    body = key.hex().encode()
    return b"%08x %s\n" % (zlib.crc32(body), body)
