"""A lane over gRPC with as little as that takes: one TCP connection, one HTTP/2 stream, no library between.

The gateway's gRPC server cannot tell it from the agent's: preface, settings, one POST, length-prefixed messages, both
flow-control windows, pings. Three channels of grpc.aio cost the simulator ten times the memory, 203 KiB a robot in
place of 20, and half as much CPU again (`python -m load_tests fleet transports`). What it saves is the gateway's.
"""

from __future__ import annotations

import asyncio
import struct
from collections import deque
from typing import Final

from load_tests.fleet.lanes import LaneCallbacks, Traffic

__all__ = ["Http2Lane", "open_http2"]

DATA, HEADERS, RST_STREAM, SETTINGS, PING, GOAWAY, WINDOW_UPDATE = 0, 1, 3, 4, 6, 7, 8
ACK = END_STREAM = 1
END_HEADERS = 4
PADDED = 8
MAX_FRAME_SIZE, INITIAL_WINDOW_SIZE = 5, 4
STREAM: Final = 1
PREFACE: Final = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
MOST_WINDOW: Final = 2**31 - 1
FIRST_WINDOW: Final = 65_535
HEAD = struct.Struct(">HBBBI")  # length in two parts, type, flags, stream
PREFIX = struct.Struct(">BI")  # of a gRPC message: compressed?, length
SETTING = struct.Struct(">HI")


def frame(kind: int, flags: int, stream: int, body: bytes = b"") -> bytes:
    """One HTTP/2 frame."""
    size = len(body)
    return HEAD.pack(size >> 8, size & 0xFF, kind, flags, stream) + body


def text(value: str) -> bytes:
    """A header's text as HPACK writes it, without Huffman's code; shorter than 127 bytes."""
    data = value.encode()
    return bytes((len(data),)) + data


def opening(authority: str) -> bytes:
    """All that a client says first. Headers are literals, so that no table of either side is used."""
    headers = b"".join(
        (
            b"\x83\x86",  # :method POST, :scheme http
            b"\x01" + text(authority),
            b"\x04" + text("/metaros.v1.Link/Connect"),
            b"\x0f\x10" + text("application/grpc"),  # content-type
            b"\x00" + text("te") + text("trailers"),
        )
    )
    settings = SETTING.pack(2, 0) + SETTING.pack(INITIAL_WINDOW_SIZE, MOST_WINDOW)
    return b"".join(
        (
            PREFACE,
            frame(SETTINGS, 0, 0, settings),
            frame(WINDOW_UPDATE, 0, 0, struct.pack(">I", MOST_WINDOW - FIRST_WINDOW)),
            frame(HEADERS, END_HEADERS, STREAM, headers),
        )
    )


class Http2Lane(asyncio.Protocol):
    """One `Link.Connect` from its client's side."""

    __slots__ = (
        "_buffer",
        "_callbacks",
        "_first_window",
        "_message",
        "_most_frame",
        "_open",
        "_opening",
        "_paused",
        "_received",
        "_taken",
        "_traffic",
        "_transport",
        "_waiting",
        "_window",
        "_window_all",
    )

    def __init__(self, authority: str, callbacks: LaneCallbacks, traffic: Traffic) -> None:
        self._callbacks = callbacks
        self._traffic = traffic
        self._opening = opening(authority)
        self._transport: asyncio.Transport | None = None
        self._buffer = b""
        self._message = b""  # gRPC's messages may be cut anywhere
        self._waiting: deque[bytes] = deque()  # for the windows
        self._window = self._first_window = self._window_all = FIRST_WINDOW
        self._most_frame = 16_384
        self._taken = 0  # received and not yet given back to the connection's window
        self._paused = False
        self._received = True
        self._open = True

    # -- the lane ---------------------------------------------------------------------------------------------------

    @property
    def full(self) -> bool:
        """Whether what was written still waits for a window or the socket."""
        return self._paused or bool(self._waiting)

    def write(self, message: bytes) -> None:
        """One AgentFrame as one gRPC message."""
        self._traffic.sent_frames += 1
        self._waiting.append(PREFIX.pack(0, len(message)) + message)
        self._flush()

    def ping(self) -> None:
        """As gRPC's keep-alive: where nothing came since the last time, ask. gRPC's own threads answer."""
        received, self._received = self._received, False
        if not received:
            self._send(frame(PING, 0, 0, bytes(8)))

    def close(self) -> None:
        """Cut it; nobody is told."""
        self._open = False
        if self._transport is not None:
            self._transport.abort()

    # -- asyncio's side ---------------------------------------------------------------------------------------------

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Say the opening words."""
        self._transport = transport  # type: ignore[assignment]  # uvloop's is no subclass of asyncio's
        self._send(self._opening)
        self._opening = b""

    def connection_lost(self, exc: Exception | None) -> None:
        """The other end, or the network, went."""
        self._end(str(exc) if exc else "the connection broke")

    def pause_writing(self) -> None:
        """The socket takes no more."""
        self._paused = True

    def resume_writing(self) -> None:
        """It does again."""
        self._paused = False
        self._flush()
        if not self.full and self._open:
            self._callbacks.room()

    def data_received(self, data: bytes) -> None:
        """Whole frames are taken, the rest waits."""
        self._received = True
        self._traffic.received_bytes += len(data)
        buffer = self._buffer + data if self._buffer else data
        at, end = 0, len(buffer)
        while end - at >= 9 and self._open:
            high, low, kind, flags, stream = HEAD.unpack_from(buffer, at)
            size = (high << 8) | low
            if end - at - 9 < size:
                break
            self._frame(kind, flags, stream, buffer[at + 9 : at + 9 + size])
            at += 9 + size
        self._buffer = buffer[at:]

    # -- frames -----------------------------------------------------------------------------------------------------

    def _frame(self, kind: int, flags: int, stream: int, body: bytes) -> None:
        if kind == DATA:
            self._data(body, flags)
        elif kind == PING and not flags & ACK:
            self._send(frame(PING, ACK, 0, body))
        elif kind == WINDOW_UPDATE:
            self._more(stream, int.from_bytes(body, "big") & MOST_WINDOW)
        elif kind == SETTINGS and not flags & ACK:
            self._settings(body)
        elif kind == HEADERS and flags & END_STREAM:
            self._end("the gateway ended the stream")
        elif kind in (RST_STREAM, GOAWAY):
            self._end("the gateway reset the stream" if kind == RST_STREAM else "the gateway goes away")

    def _data(self, body: bytes, flags: int) -> None:
        self._give_back(len(body))
        if flags & PADDED:
            body = body[1 : len(body) - body[0]]
        message = self._message + body if self._message else body
        at = 0
        while len(message) - at >= 5 and self._open:
            _, size = PREFIX.unpack_from(message, at)
            if len(message) - at - 5 < size:
                break
            self._traffic.received_frames += 1
            self._callbacks.frame(message[at + 5 : at + 5 + size])
            at += 5 + size
        self._message = message[at:]
        if flags & END_STREAM:
            self._end("the gateway ended the stream")

    def _give_back(self, size: int) -> None:
        self._taken += size
        if self._taken > MOST_WINDOW // 4:
            more = struct.pack(">I", self._taken)
            self._send(frame(WINDOW_UPDATE, 0, 0, more) + frame(WINDOW_UPDATE, 0, STREAM, more))
            self._taken = 0

    def _settings(self, body: bytes) -> None:
        for at in range(0, len(body), 6):
            name, value = SETTING.unpack_from(body, at)
            if name == INITIAL_WINDOW_SIZE:
                self._window += value - self._first_window
                self._first_window = value
            elif name == MAX_FRAME_SIZE:
                self._most_frame = value
        self._send(frame(SETTINGS, ACK, 0))
        self._flush()

    def _more(self, stream: int, size: int) -> None:
        if stream:
            self._window += size
        else:
            self._window_all += size
        was_full = self.full
        self._flush()
        if was_full and not self.full:
            self._callbacks.room()

    def _flush(self) -> None:
        """Send what the windows let through."""
        pieces: list[bytes] = []
        while self._waiting and (room := min(self._window, self._window_all, self._most_frame)) > 0:
            data = self._waiting.popleft()
            if len(data) > room:
                self._waiting.appendleft(data[room:])
                data = data[:room]
            self._window -= len(data)
            self._window_all -= len(data)
            pieces.append(frame(DATA, 0, STREAM, data))
        if pieces:
            self._send(b"".join(pieces))

    def _send(self, data: bytes) -> None:
        if self._open and self._transport is not None:
            self._traffic.sent_bytes += len(data)
            self._transport.write(data)

    def _end(self, why: str) -> None:
        if self._open:
            self.close()
            self._callbacks.over(why)


async def open_http2(host: str, port: int, callbacks: LaneCallbacks, traffic: Traffic) -> Http2Lane:
    """Connect a lane. Raises OSError."""
    loop = asyncio.get_running_loop()
    _, lane = await loop.create_connection(lambda: Http2Lane(f"{host}:{port}", callbacks, traffic), host, port)
    return lane
