"""The stream: one socket, many subscriptions; JSON for control, samples as binary records or as JSON."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Any

import orjson
from fastapi import APIRouter
from starlette.websockets import WebSocket, WebSocketDisconnect

from gateway.api.authorization import require_permission
from gateway.api.middleware.authenticate import plain_protocol
from gateway.api.open_connections import REVOKED, TOO_MANY, OpenConnection
from gateway.api.problem import error_code
from gateway.api.services import Services, services_of
from gateway.api.ws.close import STALLED, close_socket
from gateway.api.ws.records import BinaryRecords, JsonMessages
from gateway.api.ws.requests import SamplesRequest, make_feed, number_of, read_request, read_samples
from gateway.api.ws.resume import Resumption
from gateway.api.ws.send_queue import SendQueue
from gateway.domain.channel import Channel
from gateway.domain.records import introduction
from gateway.errors import ForbiddenError, InvalidRequestError, TooManyError
from gateway.identity.permissions import permission
from gateway.live.encoding import Encoding
from gateway.live.feeds import Feeds, MetricSubscription
from gateway.live.subscription import Identity, TopicSubscription
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["router"]

PROTOCOL = 1

log = logging.getLogger(__name__)
router = APIRouter()


@router.websocket("/api/v1/stream", dependencies=[require_permission("telemetry.read")])
async def stream(socket: WebSocket) -> None:
    """One viewer's connection, until it goes or stalls."""
    services = services_of(socket)
    await socket.accept(plain_protocol(socket.scope))
    open_connections = services.open_connections
    with open_connections.track(socket) as connection:
        if open_connections.viewers_full(connection.principal):
            await socket.close(TOO_MANY, "too_many")
            return
        with open_connections.count_viewer(connection.principal):
            await _Connection(socket, services, connection).run()


class _Connection:
    """A reader of requests, a viewer for samples, and a paced sender of what is JSON anyway."""

    def __init__(self, socket: WebSocket, services: Services, connection: OpenConnection) -> None:
        self._socket = socket
        self._services = services
        self._connection = connection
        self._send_queue = SendQueue(socket, clock=services.clock, stall_s=services.settings.viewer_stall_s)
        self._viewer = services.hub.join(self._send_queue, on_dropped=self._dropped)
        self._feeds, self._wake = Feeds(), asyncio.Event()
        self._resumptions: dict[int, asyncio.Task[None]] = {}
        self._introduced: dict[Identity, int] = {}
        self._handlers: dict[str, Callable[[dict[str, Any]], None]] = {
            "subscribe": self._subscribe,
            "subscribe_metrics": self._subscribe_feed,
            "subscribe_fleet": self._subscribe_feed,
            "unsubscribe": self._unsubscribe,
        }

    async def run(self) -> None:
        """Serve until either side ends it."""
        unfeed = self._services.hub.feed(self._feeds, self._wake.set)
        self._say(self._welcome())
        over, stalled = (
            asyncio.create_task(self._connection.revoked.wait()),
            asyncio.create_task(self._send_queue.stalled()),
        )
        tasks = [asyncio.create_task(self._read()), asyncio.create_task(self._send_feeds()), over, stalled]
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
            self._viewer.close()
            self._send_queue.close()
            unfeed()
            tasks += self._resumptions.values()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _read(self) -> None:
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            self._handle(message.get("text"))

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
            self._say({"op": "error", "id": shown, "code": error_code(error), "message": str(error)[:500]})

    def _subscribe(self, request: dict[str, Any]) -> None:
        asked = read_samples(request, self._connection.principal)
        self._check_number(asked.number)
        subscription = TopicSubscription(
            asked.number,
            asked.wants,
            lambda channel: self._encoding(channel, asked),
            max_rate_hz=asked.max_rate_hz,
            latest=asked.latest,
            queue_bytes=asked.queue_bytes,
        )
        if asked.resume:
            self._resume(subscription, asked)
        else:
            self._viewer.subscribe(subscription)

    def _resume(self, subscription: TopicSubscription, asked: SamplesRequest) -> None:
        """What is stored first, by a task that ends in the live subscription."""
        if not permission("history.read").granted(self._connection.principal):
            raise ForbiddenError("history.read is needed to resume")
        services = self._services
        resumption = Resumption(
            services.hub, self._viewer, self._send_queue, subscription, read=services.history.read, say=self._say
        )
        task = asyncio.create_task(resumption.run(list(asked.resume), services.clock.wall_ns))
        self._resumptions[asked.number] = task
        task.add_done_callback(lambda _: self._filled(asked.number))

    def _filled(self, number: int) -> None:
        task = self._resumptions.pop(number, None)
        if task is not None and not task.cancelled() and (error := task.exception()) is not None:
            log.error("a resumed subscription failed", exc_info=error)

    def _encoding(self, channel: Channel, asked: SamplesRequest) -> Encoding:
        """How that subscription gets that channel; the client is told of the channel first."""
        number = self._introduced.get(channel.identity)
        if number is None:
            number = self._introduced[channel.identity] = self._services.hub.number_of(channel)
            self._say(introduction(channel, number))
        return JsonMessages(asked.number, number) if asked.json else BinaryRecords(asked.number, number)

    def _subscribe_feed(self, request: dict[str, Any]) -> None:
        services = self._services
        subscription = make_feed(
            request,
            revisions=lambda: {record.robot.id: record.revision for record in services.registry.all()},
            describe=services.describe,
            principal=self._connection.principal,
        )
        self._check_number(subscription.number)
        self._feeds.add(subscription)
        if isinstance(subscription, MetricSubscription):
            for record in services.registry.all():  # it takes in only what its viewer sees
                subscription.offer(record.robot.id, record.newest())
        self._wake.set()

    def _check_number(self, number: int) -> None:
        topics = self._viewer.topics
        if len(topics) + len(self._feeds) + len(self._resumptions) >= LIMITS.subscriptions_per_viewer:
            raise TooManyError(f"a connection has at most {LIMITS.subscriptions_per_viewer} subscriptions")
        if number in self._feeds or number in self._resumptions or any(item.number == number for item in topics):
            raise InvalidRequestError(f"id {number} is in use on this connection")

    def _unsubscribe(self, request: dict[str, Any]) -> None:
        number = number_of(request)
        if number in self._feeds:
            self._feeds.remove(number)
        elif number in self._resumptions:
            self._resumptions.pop(number).cancel()
        else:
            self._viewer.unsubscribe(number)

    async def _send_feeds(self) -> None:
        """Write values and fleet as they become due, while the client takes them."""
        clock = self._services.clock
        while True:
            await self._pause()
            await self._send_queue.drain()
            self._wake.clear()
            for message in self._feeds.take(clock.monotonic_s()):
                self._say(message)
            await asyncio.sleep(self._services.settings.tick_s)

    async def _pause(self) -> None:
        """Wait until something arrives or is due."""
        due_s = self._feeds.due_s()
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

    def _dropped(self, number: int, count: int, total: int) -> None:
        self._say({"op": "dropped", "id": number, "count": count, "total": total})

    def _say(self, message: dict[str, Any]) -> None:
        self._send_queue.text(orjson.dumps(message))

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
