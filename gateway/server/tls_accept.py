"""Connections of a TLS port: each is accepted, counted, shakes hands within its time, and is then HTTP.

The event loops' own TLS servers shake hands before anybody could count: who opens connections and says nothing would
take all there are. And a connection cannot be lifted to TLS once the loop reads from it: what has come by then is lost.
So sockets are accepted here and given to the loop when they are counted, with the certificate of the moment.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import ssl
import sys
from collections.abc import Callable
from typing import Any, cast

from gateway.server.connections import Connection, ConnectionLimits

__all__ = ["TlsAcceptor"]

log = logging.getLogger(__name__)

HANDSHAKE = b"\x16"  # what every TLS connection begins with
PAUSE_S = 0.1  # after a failed accept: there are no files left, say
_SAID = b"This port speaks TLS: come by https://\n"
PLAIN = b"HTTP/1.1 400 Bad Request\r\nContent-Type: text/plain\r\nConnection: close\r\nContent-Length: %d\r\n\r\n%s" % (
    len(_SAID),
    _SAID,
)


class TlsAcceptor:
    """The accepting side of one port."""

    def __init__(
        self,
        listener: socket.socket,
        *,
        connection_limits: ConnectionLimits,
        context: Callable[[], ssl.SSLContext],
        protocol: Callable[[Connection], asyncio.Protocol],
    ) -> None:
        """`context` is asked at each handshake; `protocol` makes what speaks HTTP over a connection."""
        self._listener = listener
        self._connection_limits = connection_limits
        self._context = context
        self._protocol = protocol
        self._shaking: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Accept until cancelled; handshakes that are under way end with it."""
        loop = asyncio.get_running_loop()
        try:
            while True:
                try:
                    sock, _ = await loop.sock_accept(self._listener)
                except OSError as error:
                    log.warning("a connection cannot be accepted: %s", error)
                    await asyncio.sleep(PAUSE_S)
                    continue
                self._welcome(sock)
        finally:
            for task in self._shaking:
                task.cancel()

    def _welcome(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        accepted = _Accepted(sock)
        connection = self._connection_limits.add(cast("asyncio.Transport", accepted))
        if connection is None:
            sock.close()
            return
        task = accepted.task = asyncio.get_running_loop().create_task(self._shake(sock, connection))
        self._shaking.add(task)
        task.add_done_callback(self._shaking.discard)

    async def _shake(self, sock: socket.socket, connection: Connection) -> None:
        """From the first byte to HTTP."""
        accepted, ours = connection.transport, True
        try:
            async with asyncio.timeout(self._connection_limits.limits.head_s):
                first = await _first_byte(sock)
                if first == HANDSHAKE:
                    ours = False  # from here on the loop closes it, whatever happens
                    await asyncio.get_running_loop().connect_accepted_socket(
                        lambda: self._protocol(connection), sock, ssl=self._context()
                    )
                elif first:
                    with contextlib.suppress(OSError):
                        sock.send(PLAIN)
        except (OSError, TimeoutError):  # ssl.SSLError is an OSError
            pass
        finally:
            if connection.transport is accepted:  # it did not become HTTP
                self._connection_limits.remove(connection)
            if ours:
                sock.close()


class _Accepted:
    """A connection that is no transport yet, as far as `ConnectionLimits` needs one."""

    def __init__(self, sock: socket.socket) -> None:
        self._sock = sock
        self.task: asyncio.Task[None] | None = None

    def get_extra_info(self, name: str) -> Any:
        """The other end's address as `peername`; None when it is gone already."""
        with contextlib.suppress(OSError):
            return self._sock.getpeername() if name == "peername" else None
        return None

    def is_closing(self) -> bool:
        """It is not: an end comes at once."""
        return False

    def get_write_buffer_size(self) -> int:
        """Nothing was written yet."""
        return 0

    def abort(self) -> None:
        """End the handshake; its task closes the socket."""
        if self.task is not None:
            self.task.cancel()


async def _first_byte(sock: socket.socket) -> bytes:
    """What comes first, left where it is; b"" when the other end has gone."""
    if sys.platform == "win32":  # its loop cannot wait without reading: who speaks plainly is cut by TLS itself
        return HANDSHAKE
    else:
        loop = asyncio.get_running_loop()
        readable = asyncio.Event()
        loop.add_reader(sock, readable.set)
        try:
            await readable.wait()
        finally:
            loop.remove_reader(sock)
        return sock.recv(1, socket.MSG_PEEK)
