"""The link over a WebSocket: one socket is one lane, its binary messages are the frames that gRPC carries."""

from __future__ import annotations

import contextlib

from fastapi import APIRouter
from google.protobuf.message import DecodeError
from starlette.websockets import WebSocket, WebSocketDisconnect

from gateway.api.authorization import require_permission
from gateway.api.middleware.authenticate import is_local
from gateway.api.middleware.rate import address_of
from gateway.api.services import services_of
from gateway.api.ws.close import STALLED, close_socket
from gateway.domain.identity import Peer
from gateway.ingest.lane_server import LaneGoneError, serve_lane
from metaros._proto import link_pb2

__all__ = ["SUBPROTOCOL", "router"]

SUBPROTOCOL = "metaros.link.v1"
NORMAL, UNSUPPORTED, INVALID = 1000, 1003, 1007

router = APIRouter()


@router.websocket("/api/v1/link", dependencies=[require_permission("agent.link")])
async def link(socket: WebSocket) -> None:
    """One lane of an agent."""
    if SUBPROTOCOL not in socket.scope["subprotocols"]:
        await socket.close()  # before accept: the handshake is answered with 403
        return
    await socket.accept(SUBPROTOCOL)
    lane = _Frames(socket)
    peer = Peer(local=is_local(socket.scope), address=address_of(socket.scope))
    finished = await serve_lane(services_of(socket).links, lane.read, lane.write, peer=peer)
    if lane.gone:
        return
    if not finished:
        await close_socket(socket, STALLED, "stalled")
        return
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # it went in this very moment
        await socket.close(lane.code, lane.reason)


class _Frames:
    """Frames in and out of a socket, and how it ended."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self.gone = False
        self.code, self.reason = NORMAL, ""

    async def read(self) -> link_pb2.AgentFrame | None:
        """The next frame; None when the socket is gone or what came is none."""
        message = await self._socket.receive()
        if message["type"] == "websocket.disconnect":
            self.gone = True
            return None
        if (data := message.get("bytes")) is None:
            self.code, self.reason = UNSUPPORTED, "frames are binary"
            return None
        try:
            return link_pb2.AgentFrame.FromString(data)
        except DecodeError:
            self.code, self.reason = INVALID, "no AgentFrame"
            return None

    async def write(self, frame: link_pb2.GatewayFrame) -> None:
        """Write a frame; waits while the agent takes no more."""
        try:
            await self._socket.send({"type": "websocket.send", "bytes": frame.SerializeToString()})
        except (WebSocketDisconnect, RuntimeError) as error:
            self.gone = True
            raise LaneGoneError("the socket is gone") from error
