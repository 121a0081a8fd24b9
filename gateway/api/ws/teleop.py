"""Driving over a socket: take, drive, stop, release. A closed socket stops the robot and gives the lease back."""

from __future__ import annotations

import asyncio
from typing import Any

import orjson
from fastapi import APIRouter
from starlette.websockets import WebSocket, WebSocketDisconnect

from gateway.api.allow import allow
from gateway.api.attendance import REVOKED
from gateway.api.authenticate import plain_protocol
from gateway.api.problem import error_code
from gateway.api.services import services_of
from gateway.api.ws.cut import cut
from gateway.api.ws.requests import number_field, read_request, text_field
from gateway.errors import InvalidRequestError, LeaseTakenError
from gateway.fleet.teleop import Drive, TeleopDesk
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["router"]

MAX_SPEED = 100.0  # m/s and rad/s; what a robot can really do is its base's business
MAX_SEQ = 2.0**53
MAX_STAMP = 2.0**62

router = APIRouter()


@router.websocket("/api/v1/robots/{robot_id}/teleop", dependencies=[allow("robots.drive")])
async def teleop(socket: WebSocket, robot_id: str) -> None:
    """One driver's connection."""
    services = services_of(socket)
    await socket.accept(plain_protocol(socket.scope))
    with services.attendance.visit(socket) as visit:
        wheel = _Wheel(socket, services.teleop, robot_id)
        driving, over = asyncio.create_task(wheel.run()), asyncio.create_task(visit.over.wait())
        try:
            await asyncio.wait({driving, over}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            driving.cancel()  # whatever the end, it stops the robot and gives the lease back
            over.cancel()
            await asyncio.gather(driving, over, return_exceptions=True)
        if visit.over.is_set():
            await cut(socket, REVOKED, "bad_credentials")


class _Wheel:
    """The shell around a Drive."""

    def __init__(self, socket: WebSocket, desk: TeleopDesk, robot_id: str) -> None:
        self._socket = socket
        self._desk = desk
        self._robot = robot_id
        self._drive: Drive | None = None
        self._watcher: asyncio.Task[None] | None = None

    async def run(self) -> None:
        """Serve until the socket ends; whatever the end, stop and release."""
        try:
            while True:
                message = await self._socket.receive()
                if message["type"] == "websocket.disconnect":
                    return
                await self._handle(message.get("text"))
        except (WebSocketDisconnect, RuntimeError, TimeoutError):
            return
        finally:
            await self._end()

    async def _handle(self, text: str | None) -> None:
        try:
            request = read_request(text)
            op = request.get("op")
            if op == "take":
                await self._take(request)
            elif op == "drive":
                await self._steer(request)
            elif op == "stop":
                self._desk.stop(self._held())
            elif op == "release":
                await self._end()
                await self._say({"op": "released"})
            else:
                raise InvalidRequestError("op is one of take, drive, stop, release")
        except LeaseTakenError as error:
            op = "refused" if self._drive is None else "lost"
            await self._lose(op, error.code, str(error), holder=error.holder)
        except InvalidRequestError as error:
            await self._say({"op": "error", "code": error.code, "message": str(error)})
        except MetarosError as error:
            await self._lose("refused" if self._drive is None else "lost", error_code(error), str(error))

    async def _take(self, request: dict[str, Any]) -> None:
        if self._drive is not None:
            raise InvalidRequestError("this socket drives already")
        drive = self._drive = await self._desk.take(self._robot, text_field(request, "holder"))
        self._watcher = asyncio.create_task(self._watch(drive))
        granted = {"op": "granted", "lease_id": drive.lease_id, "expires_in_s": LIMITS.lease_s, "topic": drive.topic}
        await self._say(granted)

    async def _steer(self, request: dict[str, Any]) -> None:
        linear = number_field(request, "linear", None, low=-MAX_SPEED, high=MAX_SPEED)
        angular = number_field(request, "angular", None, low=-MAX_SPEED, high=MAX_SPEED)
        seq = number_field(request, "seq", 0.0, low=0.0, high=MAX_SEQ)
        sent_ns = number_field(request, "sent_ns", 0.0, low=0.0, high=MAX_STAMP)
        await self._desk.drive(self._held(), linear=linear, angular=angular, sent_ns=int(sent_ns))
        await self._say({"op": "ack", "seq": int(seq), "rtt_ms": self._desk.rtt_ms(self._robot)})

    def _held(self) -> Drive:
        if self._drive is None:
            raise InvalidRequestError("take the lease first")
        return self._drive

    async def _watch(self, drive: Drive) -> None:
        """Tell the driver at once when the robot's link goes."""
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
            await self._desk.release(drive)

    async def _say(self, reply: dict[str, Any]) -> None:
        async with asyncio.timeout(LIMITS.viewer_stall_s):
            await self._socket.send({"type": "websocket.send", "text": orjson.dumps(reply).decode()})
