"""Writes frames to one WebSocket: straight into uvicorn's transport, or message by message through ASGI.

The one module besides `close.py` that knows uvicorn's protocol object. With it, ready-made frames go into the transport
as they are: one buffer, shared by all sockets that get the same. Without it (another server, a test client) the frames
are taken apart again and sent as ASGI messages; slower, and the same to the client.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections import deque
from collections.abc import Callable, Iterator
from socket import IPPROTO_TCP
from typing import Any, Protocol

from starlette.websockets import WebSocket, WebSocketState
from websockets.protocol import State

from gateway.api.middleware.guard import PROTOCOL_KEY

__all__ = [
    "BINARY",
    "TEXT",
    "AsgiWriter",
    "SocketWriter",
    "UvicornWriter",
    "frame",
    "frame_header",
    "open_writer",
    "split_frames",
    "take_messages",
]

TEXT, BINARY = 1, 2
UNSENT_BYTES = 256 * 1024
TCP_NOTSENT_LOWAT = 25  # Linux; Python's socket module knows it only from 3.12 on
ROOM_BYTES = 64 * 1024  # that wait in the fallback before it takes no more


def frame(opcode: int, payload: bytes) -> bytes:
    """One whole message as a WebSocket frame from a server: `opcode` is TEXT or BINARY."""
    return frame_header(opcode, len(payload)) + payload


def frame_header(opcode: int, size_bytes: int) -> bytes:
    """What stands before a whole message of so many bytes."""
    if size_bytes < 126:
        return bytes((0x80 | opcode, size_bytes))
    if size_bytes < 65536:
        return bytes((0x80 | opcode, 126)) + size_bytes.to_bytes(2, "big")
    return bytes((0x80 | opcode, 127)) + size_bytes.to_bytes(8, "big")


def split_frames(data: bytes) -> Iterator[tuple[int, bytes]]:
    """(opcode, payload) of frames as `frame` makes them."""
    at = 0
    while at < len(data):
        opcode, size = data[at] & 0x0F, data[at + 1]
        at += 2
        if size >= 126:
            width = 2 if size == 126 else 8
            size = int.from_bytes(data[at : at + width], "big")
            at += width
        yield opcode, data[at : at + size]
        at += size


class SocketWriter(Protocol):
    """Writes whole frames, with back-pressure."""

    @property
    def waiting_bytes(self) -> int:
        """What was written and has not reached the network yet."""

    @property
    def closed(self) -> bool:
        """Whether the connection has ended."""

    def ready(self) -> bool:
        """Whether more may be written now."""

    def write(self, data: bytes, /) -> None:
        """Whole frames."""

    async def drain(self) -> None:
        """Until it is ready or closed."""

    def close(self) -> None:
        """Nothing more is written."""


class UvicornWriter:
    """Into uvicorn's transport."""

    def __init__(self, protocol: Any, on_full: Callable[[], None]) -> None:
        self._connection = protocol.conn
        self._transport: asyncio.Transport = protocol.transport
        self._writable = protocol.writable = _Writable(self._transport, on_full, was=protocol.writable.is_set())
        self._is_writable = self._writable.is_set
        self.write = self._transport.write
        _hold_little(self._transport)

    @property
    def waiting_bytes(self) -> int:
        """What the transport holds."""
        return self._transport.get_write_buffer_size()

    @property
    def closed(self) -> bool:
        """Whether it is closing, from either side."""
        return self._connection.state is not State.OPEN or self._transport.is_closing()

    def ready(self) -> bool:
        """Whether the transport is open and below its high-water mark."""
        return self._is_writable() and self._connection.state is State.OPEN and not self._transport.is_closing()

    async def drain(self) -> None:
        """Until it fell below its low-water mark."""
        await self._writable.wait()

    def close(self) -> None:
        """The transport belongs to uvicorn."""


class _Writable(asyncio.Event):
    """What uvicorn clears when its transport is full, and sets when it is so no more or the connection is lost."""

    def __init__(self, transport: asyncio.Transport, on_full: Callable[[], None], *, was: bool) -> None:
        super().__init__()
        self._transport, self._on_full = transport, on_full
        if was:
            super().set()

    def clear(self) -> None:
        """The transport is full."""
        super().clear()
        self._on_full()

    def set(self) -> None:
        """It has room; or there is nobody any more to write to."""
        super().set()
        if self._transport.is_closing():
            self._on_full()


class AsgiWriter:
    """Through the ASGI send of a socket, by a task of its own."""

    def __init__(self, socket: WebSocket, on_full: Callable[[], None]) -> None:
        self._socket = socket
        self._on_full = on_full
        self._queue: deque[tuple[int, bytes]] = deque()
        self._waiting_bytes = 0
        self._filled, self._emptied = asyncio.Event(), asyncio.Event()
        self._task = asyncio.create_task(self._run())

    @property
    def waiting_bytes(self) -> int:
        """What the task has not sent yet."""
        return self._waiting_bytes

    @property
    def closed(self) -> bool:
        """Whether the socket has ended."""
        return self._task.done() or self._socket.application_state is not WebSocketState.CONNECTED

    def ready(self) -> bool:
        """Whether little waits."""
        return self._waiting_bytes < ROOM_BYTES and not self.closed

    def write(self, data: bytes) -> None:
        """Let whole frames wait for the task."""
        for opcode, payload in split_frames(data):
            self._queue.append((opcode, payload))
            self._waiting_bytes += len(payload)
        self._emptied.clear()
        self._filled.set()
        if not self.ready():
            self._on_full()

    async def drain(self) -> None:
        """Until all of it is sent."""
        while self._queue and not self.closed:
            await self._emptied.wait()

    def close(self) -> None:
        """End the task."""
        self._task.cancel()

    async def _run(self) -> None:
        try:
            while True:
                await self._filled.wait()
                self._filled.clear()
                while self._queue:
                    opcode, payload = self._queue[0]
                    await self._send(opcode, payload)
                    self._queue.popleft()
                    self._waiting_bytes -= len(payload)
                self._emptied.set()
        except Exception:  # whatever ends a socket: its reader is told of it by ASGI
            return
        finally:
            self._emptied.set()
            self._on_full()

    async def _send(self, opcode: int, payload: bytes) -> None:
        message: dict[str, Any] = {"type": "websocket.send"}
        message |= {"text": payload.decode()} if opcode == TEXT else {"bytes": payload}
        await self._socket.send(message)


def _hold_little(transport: asyncio.Transport) -> None:
    """Let the system hold little that it has not sent: what waits there is old by the time it goes, and is memory."""
    connection = transport.get_extra_info("socket")
    if connection is not None and sys.platform == "linux":
        with contextlib.suppress(OSError):  # no TCP
            connection.setsockopt(IPPROTO_TCP, TCP_NOTSENT_LOWAT, UNSENT_BYTES)


def take_messages(socket: WebSocket, size_bytes: int) -> None:
    """Take messages of a known client of up to so many bytes, instead of what everybody may send."""
    connection: Any = getattr(socket.scope.get(PROTOCOL_KEY), "conn", None)
    if connection is not None and hasattr(connection, "max_message_size"):
        connection.max_message_size = size_bytes


def open_writer(socket: WebSocket, on_full: Callable[[], None]) -> SocketWriter:
    """The fast way where the server is the uvicorn we know, else the one that ASGI has.

    `on_full` is called when it takes nothing more: for now, or because the connection has ended.
    """
    protocol = socket.scope.get(PROTOCOL_KEY)
    transport, connection = getattr(protocol, "transport", None), getattr(protocol, "conn", None)
    known = hasattr(transport, "get_write_buffer_size") and hasattr(connection, "state")
    if known and isinstance(getattr(protocol, "writable", None), asyncio.Event):
        return UvicornWriter(protocol, on_full)
    return AsgiWriter(socket, on_full)
