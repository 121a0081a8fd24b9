"""The outgoing side of one WebSocket, in order: its own control messages, and frames that were made once for many.

Frames are written while the socket takes them. Where it does not, control messages wait here, bounded in bytes, and
samples wait with their viewer (gateway/live/viewer.py). Who takes nothing for `stall_s` is `stalled`.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable

from starlette.websockets import WebSocket

from gateway.api.ws.writer import BINARY, TEXT, frame, open_writer
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["BINARY", "TEXT", "SendQueue", "frame"]

CONTROL_BYTES = 1024 * 1024


class SendQueue:
    """Everything that goes out on an accepted socket; nothing else may send on it. Lives on the event loop."""

    def __init__(
        self,
        socket: WebSocket,
        *,
        clock: Clock,
        stall_s: float = LIMITS.viewer_stall_s,
        control_bytes: int = CONTROL_BYTES,
    ) -> None:
        self.on_full: Callable[[], None] | None = None
        self.on_drained: Callable[[], None] | None = None
        self._writer = open_writer(socket, self._fill)
        self._clock = clock
        self._stall_s = stall_s
        self._control_most = control_bytes
        self._control: deque[bytes] = deque()
        self._control_bytes = 0
        self._stalled = asyncio.Event()
        self._watch: asyncio.Task[None] | None = None
        self._closed = False
        self.write = self._writer.write  # whole frames of `frame`, joined; only after `ready`

    @property
    def waiting_bytes(self) -> int:
        """What was written or said and is not on its way yet."""
        return self._writer.waiting_bytes + self._control_bytes

    def ready(self) -> bool:
        """Whether the socket takes more now; after a False, `on_drained` is called when it does."""
        if self._watch is None and self._writer.ready():
            return True
        self._fill()
        return False

    def text(self, message: str | bytes) -> None:
        """A text message of this socket's own."""
        self._say(frame(TEXT, message.encode() if isinstance(message, str) else message))

    def binary(self, message: bytes) -> None:
        """A binary message of this socket's own."""
        self._say(frame(BINARY, message))

    async def drain(self) -> None:
        """Until it is ready, or closed."""
        while not self.ready() and self._watch is not None:
            await asyncio.wait({self._watch})

    async def stalled(self) -> None:
        """Until the client took nothing for `stall_s`, or let too many control messages wait."""
        await self._stalled.wait()

    def close(self) -> None:
        """Write nothing more; more than once does nothing."""
        self._closed = True
        self._fill()
        self.on_full = self.on_drained = None
        self._writer.close()
        if self._watch is not None:
            self._watch.cancel()

    def _say(self, data: bytes) -> None:
        if self._closed:
            return
        if self.ready():
            self.write(data)
            return
        self._control.append(data)
        self._control_bytes += len(data)
        if self._control_bytes > self._control_most:
            self._stalled.set()

    def _fill(self) -> None:
        """It takes nothing more: whoever writes has to wait until there is room, if there ever is."""
        if self.on_full is not None:
            self.on_full()
        if self._watch is None and not (self._closed or self._writer.closed):
            self._watch = asyncio.create_task(self._wait_for_room())

    async def _wait_for_room(self) -> None:
        least, since_s = self._writer.waiting_bytes, self._clock.monotonic_s()
        while not self._writer.closed:
            try:
                async with asyncio.timeout(min(1.0, self._stall_s / 4)):
                    await self._writer.drain()
                if self._flush():
                    break
                least = self._writer.waiting_bytes
            except TimeoutError:
                waiting, now_s = self._writer.waiting_bytes, self._clock.monotonic_s()
                if waiting < least:
                    least, since_s = waiting, now_s
                elif now_s - since_s >= self._stall_s:
                    self._stalled.set()
                    return
        self._watch = None
        if self.on_drained is not None and not self._writer.closed:
            self.on_drained()

    def _flush(self) -> bool:
        """Write control messages that wait; whether there is still room."""
        while self._control and self._writer.ready():
            data = self._control.popleft()
            self._control_bytes -= len(data)
            self.write(data)
        return self._writer.ready()
