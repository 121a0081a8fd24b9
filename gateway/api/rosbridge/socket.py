"""rosbridge over a WebSocket: `/rosbridge` for the robots one sees, `/rosbridge/ROBOT` for one under its own names."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from fastapi import APIRouter
from starlette.websockets import WebSocket, WebSocketDisconnect

from gateway.api.authorization import require_permission
from gateway.api.middleware.authenticate import plain_protocol
from gateway.api.open_connections import REVOKED, TOO_MANY, OpenConnection
from gateway.api.robot_access import RobotAccess
from gateway.api.rosbridge import requests
from gateway.api.rosbridge.advertised_services import AdvertisedServices
from gateway.api.rosbridge.calling import Calling, Goals
from gateway.api.rosbridge.client import Client
from gateway.api.rosbridge.driving import DriveLeases
from gateway.api.rosbridge.protocol import Protocol
from gateway.api.rosbridge.publishing import Publishing
from gateway.api.rosbridge.subscriptions import Subscriptions
from gateway.api.services import services_of
from gateway.api.ws.close import STALLED, TOO_MUCH, close_socket, set_close_notice
from gateway.api.ws.send_queue import SendQueue
from gateway.api.ws.writer import take_messages
from gateway.errors import TooManyRequestsError
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["router"]

HOLDER_CHARS = 64
# Who may only look sends requests, and no long messages: not in pieces either.
LOOKING = replace(LIMITS, rosbridge_message_bytes=LIMITS.socket_message_bytes)

router = APIRouter()


@router.websocket("/rosbridge", dependencies=[require_permission("telemetry.read")])
async def rosbridge(socket: WebSocket, robot: str | None = None, drive: str = "") -> None:
    """All robots that one sees, each topic behind its robot's id; or the one of `?robot=`, under its own names."""
    await _serve(socket, robot or None, drive)


@router.websocket("/rosbridge/{robot_id}", dependencies=[require_permission("telemetry.read")])
async def rosbridge_robot(socket: WebSocket, robot_id: str, drive: str = "") -> None:
    """One robot."""
    await _serve(socket, robot_id, drive)


async def _serve(socket: WebSocket, robot: str | None, drive: str) -> None:
    services = services_of(socket)
    with services.open_connections.track(socket) as connection:
        access = RobotAccess.of(socket, services, connection, robot=robot)
        await socket.accept(plain_protocol(socket.scope))
        if services.open_connections.viewers_full(connection.principal):
            await socket.close(TOO_MANY, "too_many")
            return
        if access.may("robots.publish"):
            take_messages(socket, LIMITS.json_bytes)
        with services.open_connections.count_viewer(connection.principal):
            await _Connection(socket, access, drive[:HOLDER_CHARS]).run(connection)


class _Connection:
    """A reader of requests, a worker for what is published, a viewer for what is subscribed to."""

    def __init__(self, socket: WebSocket, access: RobotAccess, holder: str) -> None:
        services = access.services
        self._socket = socket
        self._access = access
        self._send_queue = SendQueue(socket, clock=services.clock, stall_s=services.settings.viewer_stall_s)
        self._protocol = Protocol(limits=LIMITS if access.may("robots.publish") else LOOKING)
        self._client = client = Client(access, self._protocol, self._send_queue)
        self._viewer = services.hub.join(self._send_queue, on_dropped=self._dropped)
        self._subscriptions = Subscriptions(access, self._viewer, partial(client.status, "warning"))
        self._drive_leases = DriveLeases(access, holder) if holder else None
        self._publishing = Publishing(client, self._drive_leases)
        self._advertised_services = AdvertisedServices(client)
        self._handlers = self._table(Calling(client), Goals(client))
        for _, text in Protocol().fault(TooManyRequestsError(TOO_MUCH, retry_after_s=1.0)):
            set_close_notice(socket, text.decode())

    async def run(self, connection: OpenConnection) -> None:
        """Serve until either side ends it."""
        over, stalled = asyncio.create_task(connection.revoked.wait()), asyncio.create_task(self._send_queue.stalled())
        tasks = [asyncio.create_task(self._read()), asyncio.create_task(self._publishing.run()), over, stalled]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
            if over in done:
                await close_socket(self._socket, REVOKED, "bad_credentials")
            elif stalled in done:
                await close_socket(self._socket, STALLED, "stalled")
        except (WebSocketDisconnect, RuntimeError):
            return
        finally:
            await self._end(tasks)

    async def _end(self, tasks: list[asyncio.Task[Any]]) -> None:
        """What the client had is taken back; what it drives is stopped first."""
        for task in tasks:
            task.cancel()
        self._viewer.close()
        self._send_queue.close()
        self._advertised_services.close()
        if self._drive_leases is not None:
            await asyncio.shield(self._drive_leases.close())
        await self._client.close()
        await asyncio.gather(*tasks, return_exceptions=True)
        self._access.close()

    async def _read(self) -> None:
        clock = self._access.services.clock
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
        subscriptions, advertised_services, publishing = (
            self._subscriptions,
            self._advertised_services,
            self._publishing,
        )
        return {
            requests.Advertise: publishing.put,
            requests.Publish: publishing.put,
            requests.Unadvertise: publishing.put,
            requests.Subscribe: subscriptions.subscribe,
            requests.Unsubscribe: lambda request: subscriptions.unsubscribe(request.topic, request.id),
            requests.CallService: calling.call,
            requests.SendGoal: goals.send,
            requests.CancelGoal: goals.cancel,
            requests.Offer: advertised_services.advertise,
            requests.Unoffer: advertised_services.unadvertise,
            requests.ServiceResponse: advertised_services.on_response,
            requests.ActionFeedback: advertised_services.on_feedback,
            requests.ActionResult: advertised_services.on_result,
        }
