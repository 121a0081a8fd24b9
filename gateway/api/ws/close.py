"""Closes a WebSocket, also one whose client reads nothing: this reaches behind ASGI into uvicorn.

An ASGI send waits until the client has read; so a close frame never leaves for a client that reads nothing, and the
connection would linger with its buffers. With uvicorn's protocol object the close frame is queued at once and the
connection is dropped a second later. Without it (another server), the polite way is tried for a moment.
"""

from __future__ import annotations

import asyncio
import contextlib
import struct
from socket import SO_LINGER, SOL_SOCKET
from typing import Any

from starlette.types import Scope
from starlette.websockets import WebSocket

from gateway.api.middleware.guard import PROTOCOL_KEY
from metaros.limits import LIMITS

__all__ = ["STALLED", "TOO_MUCH", "close_socket", "set_close_notice"]

STALLED = 4408
GRACE_S = 1.0
TOO_MUCH = f"you send more than {LIMITS.socket_frames_per_s:g} frames or 1 MiB a second: this socket ends"


async def close_socket(socket: WebSocket, code: int, reason: str) -> None:
    """Close with `code`; drop the connection when that does not get through."""
    protocol = _protocol(socket.scope)
    if protocol is None:
        try:
            async with asyncio.timeout(GRACE_S):
                await socket.close(code, reason)
        except TimeoutError:
            return
        return
    protocol.conn.send_close(code, reason)
    protocol.transport.write(b"".join(protocol.conn.data_to_send()))
    asyncio.get_running_loop().call_later(GRACE_S, _drop, protocol.transport)


def set_close_notice(socket: WebSocket, text: str) -> None:
    """Set the message that the client gets, in its protocol, right before it is closed because it sends too much."""
    protocol: Any = socket.scope.get(PROTOCOL_KEY)
    if hasattr(protocol, "close_notice"):
        protocol.close_notice = text


def _drop(transport: asyncio.Transport) -> None:
    """End it with a reset: what the client did not take would wait in the system for minutes otherwise."""
    connection = transport.get_extra_info("socket")
    if connection is not None:
        with contextlib.suppress(OSError):  # it is gone already
            connection.setsockopt(SOL_SOCKET, SO_LINGER, struct.pack("ii", 1, 0))
    transport.abort()


def _protocol(scope: Scope) -> Any:
    protocol = scope.get(PROTOCOL_KEY)
    known = hasattr(getattr(protocol, "conn", None), "send_close") and hasattr(
        getattr(protocol, "transport", None), "abort"
    )
    return protocol if known else None
