"""A lane over a WebSocket: for networks whose proxies carry HTTP/1.1 and no gRPC. The frames are the same."""

from __future__ import annotations

import contextlib
import socket as sockets
import ssl
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus, WebSocketException
from websockets.typing import Subprotocol

from edge_agent.config.gateway_address import GatewayAddress
from edge_agent.errors import LinkError
from edge_agent.identity.credentials import Credentials
from edge_agent.uplink.transport import DEAD_PATH_S, gateway_frame
from metaros._proto import link_pb2
from metaros.limits import LIMITS

__all__ = ["SUBPROTOCOL", "WebSocketConnection", "open_websocket"]

SUBPROTOCOL = Subprotocol("metaros.link.v1")
PING_S = 20.0  # proxies end a connection whose one direction is silent for a minute
CLOSE_S = 0.25
UNSENT_BYTES = 256 * 1024  # in the kernel; more would only delay heartbeats


async def open_websocket(address: GatewayAddress, *, shown: Credentials | None = None) -> WebSocketConnection:
    """Connect a lane; with `shown`, TLS trusts the fleet's root. Raises LinkError."""
    trust = None  # reading this system's roots takes 50 ms
    if address.tls:
        trust = shown.context() if shown is not None else ssl.create_default_context()
    try:
        socket = await connect(
            address.link_url,
            ssl=trust,
            subprotocols=[SUBPROTOCOL],
            compression=None,
            max_size=LIMITS.frame_bytes,
            open_timeout=None,  # the uplink has its own
            ping_interval=PING_S,
            ping_timeout=None,  # the session knows when a gateway is dead
            close_timeout=CLOSE_S,
        )
    except InvalidStatus as error:
        raise LinkError(f"answered HTTP {error.response.status_code} to a WebSocket") from error
    except (OSError, EOFError, WebSocketException) as error:
        raise LinkError(str(error) or type(error).__name__) from error
    connection = WebSocketConnection(socket)
    if socket.subprotocol != SUBPROTOCOL:
        await connection.close()
        raise LinkError(f"something there speaks WebSocket, but not {SUBPROTOCOL}")
    tune(socket.transport.get_extra_info("socket"))
    return connection


class WebSocketConnection:
    """One connected socket."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket

    async def write(self, frame: bytes) -> None:
        """Write a frame; waits while the socket's buffer is full."""
        try:
            await self._socket.send(frame)
        except ConnectionClosed as error:
            raise LinkError(describe(error)) from error

    async def read(self) -> link_pb2.GatewayFrame:
        """The next frame."""
        try:
            data = await self._socket.recv(decode=False)
        except ConnectionClosed as error:
            raise LinkError(describe(error)) from error
        return gateway_frame(data)

    async def close(self) -> None:
        """Say so, wait a moment, and cut."""
        with contextlib.suppress(OSError, WebSocketException):
            await self._socket.close()


def tune(raw: Any) -> None:
    """Notice a dead path soon, and keep little in the kernel, where the system can."""
    for name, value in (("TCP_USER_TIMEOUT", round(DEAD_PATH_S * 1000)), ("TCP_NOTSENT_LOWAT", UNSENT_BYTES)):
        option = getattr(sockets, name, None)
        if option is not None and raw is not None:
            with contextlib.suppress(OSError):
                raw.setsockopt(sockets.IPPROTO_TCP, option, value)


def describe(error: ConnectionClosed) -> str:
    """One line about a closed socket."""
    if error.rcvd is None:
        return "the connection broke"
    reason = f" {error.rcvd.reason}" if error.rcvd.reason else ""
    return f"the gateway closed the socket: {error.rcvd.code}{reason}"
