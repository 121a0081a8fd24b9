"""A lease holder's WebSocket: take, use, stop, release. A closed socket stops the robot and gives the lease back."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from typing import Any, Protocol

import orjson
from starlette.websockets import WebSocket, WebSocketDisconnect

from gateway.api.middleware.authenticate import plain_protocol
from gateway.api.open_connections import REVOKED
from gateway.api.problem import error_code
from gateway.api.services import services_of
from gateway.api.ws.close import close_socket
from gateway.api.ws.requests import read_request, text_field
from gateway.errors import InvalidRequestError, LeaseTakenError
from gateway.fleet.lease_manager import HeldLease
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["LeaseManager", "LeaseSocket", "serve"]


class LeaseManager(Protocol):
    """What a LeaseSocket needs of a lease manager."""

    async def take(self, robot_id: str, holder: str) -> HeldLease:
        """LeaseTakenError, RobotError."""

    def stop(self, drive: HeldLease) -> None:
        """End what is under way."""

    async def release(self, drive: HeldLease) -> None:
        """Stop, and give the lease back."""


class LeaseSocket(ABC):
    """The WebSocket side of a held lease; what is sent under the lease is its subclass's."""

    def __init__(self, socket: WebSocket, manager: LeaseManager, robot_id: str) -> None:
        self._socket = socket
        self._manager = manager
        self._robot = robot_id
        self._drive: HeldLease | None = None
        self._watcher: asyncio.Task[None] | None = None

    async def run(self) -> None:
        """Serve until the socket ends; whatever the end, stop and release."""
        try:
            while True:
                message = await self._socket.receive()
                if message["type"] == "websocket.disconnect":
                    return
                await self._handle(message.get("text"), message.get("bytes"))
        except (WebSocketDisconnect, RuntimeError, TimeoutError):
            return
        finally:
            await self._end()

    @abstractmethod
    async def _use(self, request: dict[str, Any]) -> None:
        """Carry out a request that is not of every lease; InvalidRequestError where there is none such."""

    async def _use_bytes(self, data: bytes) -> None:
        """Carry out a binary message."""
        raise InvalidRequestError("requests are JSON texts")

    def _check_take(self, request: dict[str, Any]) -> None:  # noqa: B027 - most say nothing else
        """Read what else is said with `take`; InvalidRequestError."""

    async def _handle(self, text: str | None, data: bytes | None) -> None:
        try:
            if text is None and data is not None:
                await self._use_bytes(data)
                return
            request = read_request(text)
            op = request.get("op")
            if op == "take":
                await self._take(request)
            elif op == "stop":
                self._manager.stop(self._held())
            elif op == "release":
                await self._end()
                await self._say({"op": "released"})
            else:
                await self._use(request)
        except LeaseTakenError as error:
            op = "refused" if self._drive is None else "lost"
            await self._lose(op, error.code, str(error), holder=error.holder)
        except InvalidRequestError as error:
            await self._say({"op": "error", "code": error.code, "message": str(error)})
        except MetarosError as error:
            await self._lose("refused" if self._drive is None else "lost", error_code(error), str(error))

    async def _take(self, request: dict[str, Any]) -> None:
        if self._drive is not None:
            raise InvalidRequestError("this socket holds the lease already")
        self._check_take(request)
        drive = self._drive = await self._manager.take(self._robot, text_field(request, "holder"))
        self._watcher = asyncio.create_task(self._watch(drive))
        granted = {"op": "granted", "lease_id": drive.lease_id, "expires_in_s": LIMITS.lease_s, "topic": drive.topic}
        await self._say(granted)

    def _held(self) -> HeldLease:
        if self._drive is None:
            raise InvalidRequestError("take the lease first")
        return self._drive

    async def _watch(self, drive: HeldLease) -> None:
        """Tell the holder at once when the robot's link goes."""
        await drive.gone.wait()
        if self._drive is drive:
            self._drive = None
            await self._say({"op": "lost", "code": "robot_offline", "message": f"robot {self._robot} lost its link"})

    async def _lose(self, op: str, code: str, message: str, **more: str) -> None:
        await self._end()
        await self._say({"op": op, "code": code, "message": message, **more})

    async def _end(self) -> None:
        drive, self._drive = self._drive, None
        if self._watcher is not None:
            self._watcher.cancel()
            self._watcher = None
        if drive is not None:
            await self._manager.release(drive)

    async def _say(self, reply: dict[str, Any]) -> None:
        async with asyncio.timeout(LIMITS.viewer_stall_s):
            await self._socket.send({"type": "websocket.send", "text": orjson.dumps(reply).decode()})


async def serve(socket: WebSocket, shell: LeaseSocket) -> None:
    """Serve one holder's connection for as long as they may be here."""
    await socket.accept(plain_protocol(socket.scope))
    with services_of(socket).open_connections.track(socket) as connection:
        using, over = asyncio.create_task(shell.run()), asyncio.create_task(connection.revoked.wait())
        try:
            await asyncio.wait({using, over}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            using.cancel()  # whatever the end, it stops the robot and gives the lease back
            over.cancel()
            await asyncio.gather(using, over, return_exceptions=True)
        if connection.revoked.is_set():
            await close_socket(socket, REVOKED, "bad_credentials")
