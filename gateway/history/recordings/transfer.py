"""One recording's way from the robot to the gateway's disk: parts in, offsets out. One task, bounded memory.

Parts come in order on one lane and are written on a thread, all that wait at once; only then is the robot told the new
offset. What cannot be taken (a hole, a full queue, a full disk) is dropped, and the robot is sent back to the last
good offset: that is what an offset means which is not greater than the one told before.
"""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any, Protocol

from gateway.errors import StoreError
from gateway.history.recordings.partial_files import PartialFile
from metaros._proto import link_pb2

__all__ = ["Budget", "Transfer", "TransferHooks"]

log = logging.getLogger(__name__)

RETRY_S = 5.0  # after a full disk
CORRUPT_TRIES = 3


class OnThread(Protocol):
    """Runs a blocking call off the event loop."""

    def __call__(self, job: Callable[..., Any], *args: Any) -> Awaitable[Any]:
        """Its result."""


@dataclass(slots=True)
class Budget:
    """Bytes of parts that all transfers together may hold in memory."""

    left: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferHooks:
    """Whom a transfer tells; all on the event loop."""

    wanted: Callable[[int], None]  # the robot: go on from this offset
    progress: Callable[[int, str], Awaitable[None]]  # the recording's row: bytes there, and what holds it up
    on_thread: OnThread


class Transfer:
    """Fed by `part` and `offered`, driven by `run`; all on the event loop."""

    def __init__(
        self,
        partial: PartialFile,
        *,
        size_bytes: int,
        sha256: str,
        hooks: TransferHooks,
        budget: Budget,
        window_bytes: int,
        retry_s: float = RETRY_S,
    ) -> None:
        self.partial = partial
        self.offset = 0  # on the disk
        self.paused = False  # its robot is away
        self.cancelled = False  # nobody wants it any more
        self._size_bytes = size_bytes
        self._sha256 = sha256
        self._hooks = hooks
        self._budget = budget
        self._window_bytes = window_bytes
        self._retry_s = retry_s
        self._parts: deque[bytes] = deque()
        self._queued_bytes = 0
        self._expected = 0  # where the next part begins
        self._hole = False  # something was dropped: the robot has to be sent back
        self._turning = False  # it was, and what it had sent before is still arriving
        self._offered = True
        self._stopped = False
        self._wake = asyncio.Event()

    def matches(self, part: link_pb2.RecordingPart) -> bool:
        """Whether a part belongs to this very file; one with data need not say so."""
        bare = bool(part.data) and not part.size_bytes and not part.sha256
        return bare or bool(part.size_bytes == self._size_bytes and part.sha256.hex() == self._sha256)

    def part(self, part: link_pb2.RecordingPart) -> None:
        """A piece came; what was there already is ignored, what does not follow or finds no room is dropped."""
        data, skip = part.data, self._expected - part.offset
        if skip >= len(data) or (skip < 0 and self._turning):
            return
        full = self._queued_bytes + len(data) > 2 * self._window_bytes or len(data) > self._budget.left
        if skip < 0 or full or part.offset + len(data) > self._size_bytes:
            self._hole = True
        else:
            fresh = data[skip:]
            self._parts.append(fresh)
            self._queued_bytes += len(fresh)
            self._budget.left -= len(fresh)
            self._expected += len(fresh)
            self._turning = False
        self._wake.set()

    def offered(self) -> None:
        """The robot offers it again, in a new session: tell it where to go on."""
        self.paused = False
        self._offered = True
        self._wake.set()

    def pause(self) -> None:
        """The robot is away: what waits is still written."""
        self.paused = True

    def stop(self) -> None:
        """Nobody wants it any more; `run` ends soon."""
        self.cancelled = self._stopped = True
        self._wake.set()

    async def run(self) -> bool:
        """Until the whole file is on the disk and its checksum holds: True. False: it was stopped, or is corrupt."""
        try:
            self.offset = self._expected = await self._hooks.on_thread(self.partial.size)
            for _ in range(CORRUPT_TRIES):
                await self._receive()
                if self._stopped or await self._whole():
                    return not self._stopped
                log.warning("%s: the checksum does not hold; it is asked for again", self.partial.path.name)
                await self._hooks.on_thread(self.partial.discard)
                self.offset = 0
                self._send_back()
            return False
        finally:
            self._stopped = True
            self._drop()

    async def _whole(self) -> bool:
        """Whether the file is what the robot said it is."""
        while not self._stopped:
            try:
                return bool(await self._hooks.on_thread(self.partial.digest) == self._sha256)
            except StoreError as error:
                await self._stuck(error)
        return False

    async def _receive(self) -> None:
        while self.offset < self._size_bytes and not self._stopped:
            if self._offered:
                self._offered = self._hole = self._turning = False
                self._drop()
                self._send()
            elif self._parts:
                await self._write()
            elif self._hole:
                self._send_back()
            else:
                self._wake.clear()
                await self._wake.wait()

    async def _write(self) -> None:
        """Put what waits on the disk; when that fails, say why, and try again later."""
        pieces = list(self._parts)
        held = sum(map(len, pieces))
        self._parts.clear()
        self._queued_bytes = 0
        try:
            self.offset = await self._hooks.on_thread(self.partial.append, self.offset, pieces)
        except StoreError as error:
            self._drop()
            await self._stuck(error)
            self._send_back()
            return
        finally:
            self._budget.left += held
        if not self._offered and self.offset < self._size_bytes:
            self._send()
        await self._hooks.progress(self.offset, "")

    async def _stuck(self, error: StoreError) -> None:
        """Say what holds it up, and wait a little."""
        log.warning("%s: %s", self.partial.path.name, error)
        await self._hooks.progress(self.offset, str(error))
        try:
            async with asyncio.timeout(self._retry_s):
                while not self._stopped:
                    self._wake.clear()
                    await self._wake.wait()
        except TimeoutError:
            return

    def _send_back(self) -> None:
        """The robot sends again from what is on the disk."""
        self._drop()
        self._hole, self._turning = False, True
        self._send()  # again the offset told last, or a lower one

    def _send(self) -> None:
        if not self.paused:
            self._hooks.wanted(self.offset)

    def _drop(self) -> None:
        """Forget what waits; the next part wanted is the one after what is on the disk."""
        self._budget.left += self._queued_bytes
        self._parts.clear()
        self._queued_bytes = 0
        self._expected = self.offset
