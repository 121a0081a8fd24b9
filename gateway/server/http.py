"""uvicorn's protocols with deadlines and limits for request heads, handshakes, frames and idle connections.

uvicorn reads a head of any size for as long as it takes, and its TLS handshakes are counted nowhere. So connections
are counted by `ConnectionLimits` when they are accepted; TLS starts afterwards, with a deadline; a head has its size
and time; what comes of a body after its answer is bounded; and a WebSocket's frames are counted, since a frame of one
byte costs as much as one of a thousand.
"""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame
from websockets.http11 import Request
from websockets.protocol import State

from gateway.api.middleware.guard import AGENTS_ONLY, PROTOCOL_KEY
from gateway.domain.buckets import TokenBuckets
from gateway.server.connections import Connection, ConnectionLimits
from gateway.server.one_write import OneWrite
from metaros.clock import Clock

__all__ = ["protocols"]

SURPLUS_BYTES = 32 * 1024 * 1024  # of a body that nobody asked for, behind its answer
SURPLUS_PAUSE_S = 0.1  # between two reads of it: it is read for the sake of who sends, and is not to cost others
SLICE_BYTES = 4096  # of a socket's data between two looks at how many frames they were
BURST_S = 4.0
LINK_FRAMES = 60.0  # a robot's link may send so many times the frames of a viewer
FRAGMENTS = 1024  # of one message
GOING_AWAY, TOO_OFTEN, TOO_BIG = 1001, 1008, 1009
_TOO_LARGE = (
    b"HTTP/1.1 431 Request Header Fields Too Large\r\ncontent-type: text/plain; charset=utf-8\r\n"
    b"content-length: 19\r\nconnection: close\r\n\r\nthe head is too big"
)


class HeadTooLargeError(Exception):
    """Ends the parsing of a head."""


class CountedProtocol(asyncio.Protocol):
    """What both protocols of a port report to its `ConnectionLimits`."""

    connection_limits: ConnectionLimits
    _connection: Connection | None

    def connection_lost(self, exc: Exception | None) -> None:
        """Count it out."""
        if self._connection is not None:
            self.connection_limits.remove(self._connection)
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        """The other end does not keep up."""
        if self._connection is not None:
            self._connection.write_paused = True
        super().pause_writing()

    def resume_writing(self) -> None:
        """It does again."""
        if self._connection is not None:
            self._connection.write_paused = False
        super().resume_writing()


class HttpProtocol(CountedProtocol, HttpToolsProtocol):
    """One connection."""

    def __init__(self, *args: Any, connection: Connection | None = None, **kwargs: Any) -> None:
        """`connection` is set where the connection was counted already."""
        super().__init__(*args, **kwargs)
        self._connection = connection
        self._in_head = True
        self._head_bytes = 0  # of the head that comes now: what was parsed, or what has come
        self._too_large = False
        self._body_open = False
        self._surplus = 0
        self._resting = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Count it in, or end it."""
        super().connection_made(transport)
        if self._connection is None:
            self._connection = self.connection_limits.add(transport)
            if self._connection is None:
                transport.abort()
        else:
            self.connection_limits.secured(self._connection, transport)

    def data_received(self, data: bytes) -> None:
        """Parse; a head that is too large or too late ends the connection."""
        if self.transport.is_closing() or self._connection is None:
            return
        if not self._in_head and not self._body_open and self._idle:
            self._begin_head()
        before = self._in_head
        super().data_received(data)
        if before and self._in_head and not self.transport.is_closing():
            self._head_bytes += len(data)
            if self._head_bytes > self.connection_limits.limits.head_bytes:
                self._refuse_head()

    def on_message_begin(self) -> None:
        """A request starts."""
        super().on_message_begin()
        self._head_bytes = 0
        self._in_head = True

    def on_url(self, url: bytes) -> None:
        """A piece of its line."""
        self._count(len(url))
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """One of its headers."""
        self._count(len(name) + len(value) + 4)
        super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """Its head is there."""
        self._in_head, self._body_open = False, True
        self._head_bytes = self._surplus = 0
        if self._connection is not None:
            self.connection_limits.mark_busy(self._connection)
        before = self.cycle
        super().on_headers_complete()
        if self.cycle is not before:
            self.cycle.transport = OneWrite(self.transport, self.loop)  # type: ignore[assignment]

    def on_body(self, body: bytes) -> None:
        """A piece of its body."""
        if self.cycle is not None and self.cycle.response_complete:
            self._surplus += len(body)
            if self._surplus > SURPLUS_BYTES:
                self.transport.close()
            elif not self._resting:
                self._resting = True
                self.transport.pause_reading()
                self.loop.call_later(SURPLUS_PAUSE_S, self._read_on)
        super().on_body(body)

    def _read_on(self) -> None:
        self._resting = False
        if not self.transport.is_closing():
            self.transport.resume_reading()

    def on_message_complete(self) -> None:
        """All of it is there."""
        super().on_message_complete()
        self._body_open = False
        if self._idle:
            self._rest(self.connection_limits.limits.keep_alive_s)

    def on_response_complete(self) -> None:
        """Its answer is on its way: the next request, or what is left of this one's body, has its time."""
        busy = bool(self.pipeline)
        super().on_response_complete()
        if not busy:
            limits = self.connection_limits.limits
            self._rest(limits.head_s if self._body_open or self._in_head else limits.keep_alive_s)

    def send_400_response(self, msg: str) -> None:
        """What could not be parsed."""
        if self._too_large:
            self._refuse_head()
        else:
            super().send_400_response(msg)

    @property
    def _idle(self) -> bool:
        """Whether no answer is being made."""
        return self.cycle is None or (self.cycle.response_complete and not self.pipeline)

    def _begin_head(self) -> None:
        self._in_head, self._head_bytes = True, 0
        self._rest(self.connection_limits.limits.head_s)

    def _rest(self, seconds: float) -> None:
        if self._connection is not None:
            self.connection_limits.mark_idle(self._connection, seconds)

    def _count(self, size: int) -> None:
        self._head_bytes += size
        if self._head_bytes > self.connection_limits.limits.head_bytes:
            self._too_large = True
            raise HeadTooLargeError

    def _refuse_head(self) -> None:
        self.transport.write(_TOO_LARGE)
        self.transport.close()


class SocketProtocol(CountedProtocol, WebSocketsSansIOProtocol):
    """One WebSocket, from its handshake on."""

    clock: Clock

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.close_notice = ""  # sent to a client that sends too much before its socket is closed, see ws/close.py
        self._connection: Connection | None = None
        self._pinged = False
        self._frames_seen = 0
        self._budget: TokenBuckets | None = None
        self.conn.debug = False  # its log of what comes has the whole address, and with it tokens
        self._count_frames()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The connection of an HTTP request that became a socket."""
        super().connection_made(transport)
        self._connection = self.connection_limits.find(transport)
        if self._connection is not None:
            self.connection_limits.mark_busy(self._connection)  # its request is over, the socket is not

    def handle_connect(self, event: Request) -> None:
        """How large messages may be, and how many: a robot's link carries more."""
        per_s = self.connection_limits.limits.socket_frames_per_s
        if event.path.partition("?")[0] == AGENTS_ONLY:
            per_s *= LINK_FRAMES
        else:
            self.conn.max_message_size = self.connection_limits.limits.socket_message_bytes
        self._budget = TokenBuckets(per_s=per_s, burst=per_s * BURST_S)
        super().handle_connect(event)
        if hasattr(self, "scope"):  # not where the handshake was refused
            self.scope[PROTOCOL_KEY] = self  # type: ignore[literal-required]

    def data_received(self, data: bytes) -> None:
        """Parse a little at a time, and look how many frames that were."""
        for start in range(0, len(data), SLICE_BYTES):
            if self.transport.is_closing():
                return
            super().data_received(data[start : start + SLICE_BYTES])
            if self._pinged and not self.close_sent and not self.transport.is_closing():
                self._pong()
            if len(self.frames) > FRAGMENTS:
                self._end(TOO_BIG, "fragments")
            elif not self._affordable():
                self._end(TOO_OFTEN, "too_many_requests")

    def handle_ping(self) -> None:
        """The answer waits for the end of the slice: one write for many."""
        self._pinged = True

    def _pong(self) -> None:
        """Answer pings, unless the other end does not even take what it was sent before."""
        self._pinged = False
        output = self.conn.data_to_send()
        if self.writable.is_set():
            self.transport.write(b"".join(output))

    def handle_close(self, event: Frame) -> None:
        """The client ends it."""
        super().handle_close(event)
        self._unblock_senders()

    def handle_parser_exception(self) -> None:
        """What came makes no sense, or is too much."""
        super().handle_parser_exception()
        self._unblock_senders()

    def shutdown(self) -> None:
        """The gateway ends: say 1001, "going away", where uvicorn would say that a service restarts."""
        if not self.close_sent and self.handshake_complete and not self.transport.is_closing():
            self.stop_keepalive()
            self.queue.put_nowait({"type": "websocket.disconnect", "code": GOING_AWAY})
            self.conn.send_close(GOING_AWAY)
            self.transport.write(b"".join(self.conn.data_to_send()))
            self.transport.close()
            self._unblock_senders()
        else:
            super().shutdown()

    async def send(self, message: Any) -> None:
        """As ever; a handshake that was refused with an answer is over, which uvicorn would call a failure."""
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and not message.get("more_body", False):
            self.handshake_complete = True

    def _unblock_senders(self) -> None:
        """Let nobody wait to send more: a client that takes nothing keeps the connection long after its end."""
        if self.transport.is_closing():
            self.disconnected = True
            self.writable.set()

    def _affordable(self) -> bool:
        seen, self._frames_seen = self._frames_seen, 0
        return not seen or self._budget is None or not self._budget.take(self, self.clock.monotonic_s(), seen)

    def _end(self, code: int, reason: str) -> None:
        if self.close_sent or self.transport.is_closing():
            return
        if code == TOO_OFTEN and self.close_notice and self.conn.state is State.OPEN:
            self.conn.send_text(self.close_notice.encode())
        self.conn.fail(code, reason)
        self.handle_parser_exception()

    def _count_frames(self) -> None:
        handle = self.conn.recv_frame

        def counted(frame: Any) -> None:
            self._frames_seen += 1
            handle(frame)

        self.conn.recv_frame = counted  # type: ignore[method-assign]


def protocols(
    connection_limits: ConnectionLimits, *, clock: Clock
) -> tuple[type[asyncio.Protocol], type[asyncio.Protocol]]:
    """What uvicorn's `http` and `ws` are for one port, behind TLS too."""
    http = type("CountedHttp", (HttpProtocol,), {"connection_limits": connection_limits})
    socket = type("CountedSocket", (SocketProtocol,), {"connection_limits": connection_limits, "clock": clock})
    return http, socket
