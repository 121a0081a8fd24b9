"""rosbridge over a WebSocket: `/rosbridge` for the robots one sees, `/rosbridge/ROBOT` for one under its own names."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from fastapi import APIRouter
from starlette.websockets import WebSocket, WebSocketDisconnect

from gateway.api.allow import allow
from gateway.api.attendance import REVOKED, TOO_MANY, Visit
from gateway.api.authenticate import plain_protocol
from gateway.api.rosbridge import requests
from gateway.api.rosbridge.calling import Calling, Goals
from gateway.api.rosbridge.client import Client
from gateway.api.rosbridge.driving import Wheel
from gateway.api.rosbridge.offering import Offering
from gateway.api.rosbridge.protocol import Protocol
from gateway.api.rosbridge.publishing import Publishing
from gateway.api.rosbridge.subscriptions import Subscriptions
from gateway.api.services import services_of
from gateway.api.visitor import Visitor
from gateway.api.ws.cut import STALLED, TOO_MUCH, cut, leave_word
from gateway.api.ws.outlet import take_messages
from gateway.api.ws.pipe import Pipe
from gateway.errors import TooManyRequestsError
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["router"]

HOLDER_CHARS = 64
# Who may only look sends requests, and no long messages: not in pieces either.
LOOKING = replace(LIMITS, rosbridge_message_bytes=LIMITS.socket_message_bytes)

router = APIRouter()


@router.websocket("/rosbridge", dependencies=[allow("telemetry.read")])
async def rosbridge(socket: WebSocket, robot: str | None = None, drive: str = "") -> None:
    """All robots that one sees, each topic behind its robot's id; or the one of `?robot=`, under its own names."""
    await _serve(socket, robot or None, drive)


@router.websocket("/rosbridge/{robot_id}", dependencies=[allow("telemetry.read")])
async def rosbridge_robot(socket: WebSocket, robot_id: str, drive: str = "") -> None:
    """One robot."""
    await _serve(socket, robot_id, drive)


async def _serve(socket: WebSocket, robot: str | None, drive: str) -> None:
    services = services_of(socket)
    with services.attendance.visit(socket) as visit:
        visitor = Visitor.of(socket, services, visit, robot=robot)
        await socket.accept(plain_protocol(socket.scope))
        if services.attendance.full(visit.principal):
            await socket.close(TOO_MANY, "too_many")
            return
        if visitor.may("robots.publish"):
            take_messages(socket, LIMITS.json_bytes)
        with services.attendance.place(visit.principal):
            await _Connection(socket, visitor, drive[:HOLDER_CHARS]).run(visit)


class _Connection:
    """A reader of requests, a worker for what is published, a viewer for what is subscribed to."""

    def __init__(self, socket: WebSocket, visitor: Visitor, holder: str) -> None:
        services = visitor.services
        self._socket = socket
        self._visitor = visitor
        self._pipe = Pipe(socket, clock=services.clock, stall_s=services.settings.viewer_stall_s)
        self._protocol = Protocol(limits=LIMITS if visitor.may("robots.publish") else LOOKING)
        self._client = client = Client(visitor, self._protocol, self._pipe)
        self._viewer = services.hub.join(self._pipe, on_dropped=self._dropped)
        self._subscriptions = Subscriptions(visitor, self._viewer, partial(client.status, "warning"))
        self._wheel = Wheel(visitor, holder) if holder else None
        self._publishing = Publishing(client, self._wheel)
        self._offering = Offering(client)
        self._handlers = self._table(Calling(client), Goals(client))
        for _, text in Protocol().fault(TooManyRequestsError(TOO_MUCH, retry_after_s=1.0)):
            leave_word(socket, text.decode())

    async def run(self, visit: Visit) -> None:
        """Serve until either side ends it."""
        over, stalled = asyncio.create_task(visit.over.wait()), asyncio.create_task(self._pipe.stalled())
        tasks = [asyncio.create_task(self._read()), asyncio.create_task(self._publishing.run()), over, stalled]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
            if over in done:
                await cut(self._socket, REVOKED, "bad_credentials")
            elif stalled in done:
                await cut(self._socket, STALLED, "stalled")
        except (WebSocketDisconnect, RuntimeError):
            return
        finally:
            await self._end(tasks)

    async def _end(self, tasks: list[asyncio.Task[Any]]) -> None:
        """What the client had is taken back; what it drives is stopped first."""
        for task in tasks:
            task.cancel()
        self._viewer.close()
        self._pipe.close()
        self._offering.close()
        if self._wheel is not None:
            await asyncio.shield(self._wheel.close())
        await self._client.close()
        await asyncio.gather(*tasks, return_exceptions=True)
        self._visitor.close()

    async def _read(self) -> None:
        clock = self._visitor.services.clock
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            frame = message.get("text") or message.get("bytes") or ""
            request, answer = self._protocol.receive(frame, now_s=clock.monotonic_s())
            self._client.send(answer)
            if request is not None:
                self._handle(request)

    def _handle(self, request: requests.Request) -> None:
        try:
            self._handlers[type(request)](request)
        except MetarosError as error:
            self._client.fault(error, request.id)

    def _dropped(self, number: int, lost: int, total: int) -> None:
        self._subscriptions.on_dropped(number, lost, total)

    def _table(self, calling: Calling, goals: Goals) -> dict[type[requests.Request], Callable[[Any], None]]:
        subscriptions, offering, publishing = self._subscriptions, self._offering, self._publishing
        return {
            requests.Advertise: publishing.put,
            requests.Publish: publishing.put,
            requests.Unadvertise: publishing.put,
            requests.Subscribe: subscriptions.subscribe,
            requests.Unsubscribe: lambda request: subscriptions.unsubscribe(request.topic, request.id),
            requests.CallService: calling.call,
            requests.SendGoal: goals.send,
            requests.CancelGoal: goals.cancel,
            requests.Offer: offering.advertise,
            requests.Unoffer: offering.unadvertise,
            requests.ServiceResponse: offering.on_response,
            requests.ActionFeedback: offering.on_feedback,
            requests.ActionResult: offering.on_result,
        }
