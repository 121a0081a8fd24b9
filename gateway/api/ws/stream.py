"""The stream: one socket, many subscriptions, JSON for control and binary frames for samples."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import orjson
from fastapi import APIRouter
from starlette.websockets import WebSocket, WebSocketDisconnect

from gateway.api.allow import allow
from gateway.api.attendance import REVOKED, Visit
from gateway.api.authenticate import plain_protocol
from gateway.api.problem import error_code
from gateway.api.services import Services, services_of
from gateway.api.ws.cut import STALLED, cut
from gateway.api.ws.requests import make_subscription, read_request
from gateway.errors import InvalidRequestError
from gateway.live.feeds import MetricSubscription
from gateway.live.viewer import Viewer
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["router"]

PROTOCOL = 1
MAX_VIEWERS = 1024
TOO_MANY = 4429

router = APIRouter()


@router.websocket("/api/v1/stream", dependencies=[allow("telemetry.read")])
async def stream(socket: WebSocket) -> None:
    """One viewer's connection, until it goes or stalls."""
    services = services_of(socket)
    await socket.accept(plain_protocol(socket.scope))
    if services.hub.viewers >= MAX_VIEWERS:
        await socket.close(TOO_MANY, "too_many")
        return
    with services.attendance.visit(socket) as visit:
        await _Connection(socket, services, visit).run()


class _Connection:
    """The shell around a Viewer: a reader of requests and a paced sender."""

    def __init__(self, socket: WebSocket, services: Services, visit: Visit) -> None:
        self._socket = socket
        self._services = services
        self._visit = visit
        self._viewer = Viewer()
        self._wake = asyncio.Event()
        self._replies: list[dict[str, Any]] = [self._welcome()]
        self._handlers: dict[str, Callable[[dict[str, Any]], None]] = {
            "subscribe": self._subscribe,
            "subscribe_metrics": self._subscribe,
            "subscribe_fleet": self._subscribe,
            "unsubscribe": self._unsubscribe,
        }

    async def run(self) -> None:
        """Serve until either side ends it."""
        hub = self._services.hub
        hub.join(self._viewer, self._wake.set)
        over = asyncio.create_task(self._over())
        tasks = [asyncio.create_task(self._read()), asyncio.create_task(self._send()), over]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
            if over in done:
                await cut(self._socket, REVOKED, "bad_credentials")
        except TimeoutError:
            await cut(self._socket, STALLED, "stalled")
        except (WebSocketDisconnect, RuntimeError):
            return
        finally:
            hub.leave(self._viewer)
            self._services.on_subscriptions()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _over(self) -> None:
        """Until the viewer may not be here any more."""
        await self._visit.over.wait()

    async def _read(self) -> None:
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            self._handle(message.get("text"))
            self._wake.set()

    def _handle(self, text: str | None) -> None:
        number: Any = None
        try:
            request = read_request(text)
            number = request.get("id")
            handler = self._handlers.get(str(request.get("op")))
            if handler is None:
                raise InvalidRequestError(f"op is one of {', '.join(self._handlers)}")
            handler(request)
        except MetarosError as error:
            shown = number if isinstance(number, int) else None
            if len(self._replies) < LIMITS.subscriptions_per_viewer:
                self._replies.append(
                    {"op": "error", "id": shown, "code": error_code(error), "message": str(error)[:500]}
                )

    def _subscribe(self, request: dict[str, Any]) -> None:
        services = self._services
        subscription = make_subscription(
            request,
            revisions=lambda: {record.robot.id: record.revision for record in services.registry.all()},
            describe=services.describe,
            principal=self._visit.principal,
        )
        self._viewer.add(subscription)
        if isinstance(subscription, MetricSubscription):
            for record in services.registry.all():  # it takes in only what its viewer sees
                subscription.offer(record.robot.id, record.newest())
        services.hub.changed(self._viewer)
        services.on_subscriptions()

    def _unsubscribe(self, request: dict[str, Any]) -> None:
        number = request.get("id")
        if not isinstance(number, int):
            raise InvalidRequestError("id is the number of a subscription")
        self._viewer.remove(number)
        self._services.hub.changed(self._viewer)
        self._services.on_subscriptions()

    async def _send(self) -> None:
        loop = asyncio.get_running_loop()
        sent_s = -1e9
        while True:
            for reply in self._replies:
                await self._write(orjson.dumps(reply).decode())
            self._replies.clear()
            await self._pause()
            # The first sample after a pause goes at once; a stream of them shares one write per tick.
            await asyncio.sleep(max(0.0, sent_s + self._services.settings.tick_s - loop.time()))
            sent_s = loop.time()
            self._wake.clear()
            while messages := self._viewer.take(self._services.clock.monotonic_s()):
                for message in messages:
                    await self._write(message)

    async def _pause(self) -> None:
        """Wait until something arrives or is due."""
        due_s = self._viewer.due_s()
        if self._wake.is_set():
            return
        if due_s is None:
            await self._wake.wait()
            return
        try:
            async with asyncio.timeout(max(0.0, due_s - self._services.clock.monotonic_s())):
                await self._wake.wait()
        except TimeoutError:
            return

    async def _write(self, message: str | bytes) -> None:
        async with asyncio.timeout(self._services.settings.viewer_stall_s):
            if isinstance(message, str):
                await self._socket.send({"type": "websocket.send", "text": message})
            else:
                await self._socket.send({"type": "websocket.send", "bytes": message})

    def _welcome(self) -> dict[str, Any]:
        return {
            "op": "welcome",
            "protocol": PROTOCOL,
            "gateway_id": self._services.store.gateway_id,
            "limits": {
                "subscriptions": LIMITS.subscriptions_per_viewer,
                "queue_bytes": LIMITS.viewer_queue_bytes,
                "stall_s": self._services.settings.viewer_stall_s,
            },
        }
