"""The client for asyncio; see `metaros.client`."""

from __future__ import annotations

import asyncio
import uuid
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import aclosing, asynccontextmanager
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import grpc
import grpc.aio

from metaros._proto import alerts_pb2_grpc, events_pb2_grpc, fleet_pb2_grpc, telemetry_pb2, telemetry_pb2_grpc
from metaros.client import requests, rpc
from metaros.client.access import find_access
from metaros.client.alerts_aio import AsyncAlerts
from metaros.client.drive import AsyncDrive
from metaros.client.goal import AsyncGoal
from metaros.client.http import AsyncHttp
from metaros.client.results import Command, Event, GoalUpdate, Robot, Sample, Series, Values
from metaros.client.retries import Retries, StreamRetries
from metaros.clock import SystemClock, system_rng
from metaros.errors import MetarosError, PeerError

__all__ = ["AsyncClient"]

Names = str | Sequence[str]
Reply = TypeVar("Reply")
NO_WAIT_S = 0.0


class AsyncClient:
    """A gateway. Use it in an `async with` block, or `close` it; it belongs to one event loop."""

    def __init__(
        self,
        gateway: str = "",
        *,
        key: str | None = None,
        ca: str | Path | None = None,
        grpc_target: str = "",
        timeout_s: float = 30.0,
        retries: Retries | None = None,
    ) -> None:
        """What is not given is found as the command line finds it, see `metaros.client.access`.

        Args:
            gateway: the address of its HTTP port, like `https://fleet.example`.
            key: an API key, "" for nobody's.
            ca: a file of root certificates that alone are believed.
            grpc_target: `host:port` of its gRPC port for programs, where a proxy has it elsewhere.
            timeout_s: of a request; streams last as long as they are read.
            retries: of what is safe to repeat.

        Raises:
            ConfigError: the address is none, or the user's files cannot be read.
        """
        self.access = find_access(gateway, key=key, ca=ca)
        self._retries = retries or Retries()
        self._http = AsyncHttp(self.access, timeout_s=timeout_s, retries=self._retries)
        self._target, self._timeout_s, self._rng = grpc_target, timeout_s, system_rng()
        self._channel: grpc.aio.Channel | None = None
        self.alerts = AsyncAlerts(self._http, self._follow_alerts)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """End its connections, and with them its streams."""
        await self._http.close()
        if self._channel is not None:
            await self._channel.close()

    async def robots(self, *, selector: str | None = None) -> list[Robot]:
        """Every robot in scope, by id; of those that `selector` names, like `site=lab`."""
        found: list[Robot] = []
        after: Any = None
        while True:
            page, after = await self._http.send(requests.robots(selector=selector, after=after))
            found += page
            if after is None:
                return found

    async def robot(self, robot: str) -> Robot:
        """One robot."""
        return await self._http.send(requests.get(requests.robot_path(robot), Robot.of))

    async def publish(
        self,
        robot: str,
        topic: str,
        message: Any,
        *,
        type_name: str = "",
        lease_id: str = "",
        sent_ns: int = 0,
        timeout_s: float | None = None,
    ) -> None:
        """Publish once on a robot: a message of a message class, or its values as a mapping. Never sent twice.

        `type_name` may be left out where the robot announces the topic. Returns when the robot's agent has done it.
        """
        await self._http.send(
            requests.publish(
                robot, topic, message, type_name=type_name, lease_id=lease_id, sent_ns=sent_ns, timeout_s=timeout_s
            )
        )

    async def call(
        self,
        robot: str,
        service: str,
        request: Mapping[str, Any] | None = None,
        *,
        type_name: str = "",
        timeout_s: float = 10.0,
        lease_id: str = "",
    ) -> Any:
        """Call a service of a robot; its answer as a mapping. Never sent twice."""
        asked = requests.call(
            robot, service, request or {}, type_name=type_name, timeout_s=timeout_s, lease_id=lease_id
        )
        return await self._http.send(asked)

    async def send_goal(
        self,
        robot: str,
        action: str,
        goal: Mapping[str, Any] | None = None,
        *,
        type_name: str = "",
        timeout_s: float = 10.0,
        lease_id: str = "",
    ) -> AsyncGoal:
        """Start an action: iterate over how it goes, or wait for its `result()`. Never sent twice.

        Raises:
            RefusedError: the robot, the action or its type is not known, or the goal does not fit.
        """
        request = rpc.goal_request(robot, action, goal, type_name=type_name, timeout_s=timeout_s, lease_id=lease_id)
        replies = self._stream((await self._telemetry()).SendGoal, request)
        first = await anext(replies, None)
        if first is None:
            raise PeerError("the gateway said nothing of the goal")

        async def updates() -> AsyncGenerator[GoalUpdate, None]:
            yield rpc.goal_update(first)
            async for reply in replies:
                yield rpc.goal_update(reply)

        return AsyncGoal(first.goal, updates(), partial(self._cancel_goal, robot))

    async def subscribe(
        self,
        topics: Names | None = None,
        *,
        robots: Names | None = None,
        series: Names | None = None,
        rate_hz: float = 0.0,
        latest: bool = False,
        queue_bytes: int = 0,
        decode: bool = True,
    ) -> AsyncGenerator[Sample | Values, None]:
        """Samples as they arrive, and newest values of series, of robots and names by pattern; end it by leaving it.

        A relative topic counts in each robot's namespace. At most `rate_hz` a second of each channel, 0 for all;
        `latest` has only the newest wait for a slow reader, else up to `queue_bytes` (1 MiB), the oldest goes first.
        After a loss of the connection it begins again, without what came meanwhile: a hole in a topic's `seq` is what
        was lost, to the slow reader too.
        """
        asked = rpc.subscribe_request(topics, series, robots, rate_hz=rate_hz, latest=latest, queue_bytes=queue_bytes)
        async with aclosing(self._again(self._subscribing, lambda: asked, decode=decode)) as replies:
            async for reply, samples in replies:
                for sample in samples.live(reply):
                    yield sample

    async def history(
        self,
        robot: str,
        topics: Names | None = None,
        *,
        start: str = "-15m",
        end: str = "now",
        limit: int = 0,
        newest_first: bool = False,
        decode: bool = True,
    ) -> AsyncGenerator[Sample, None]:
        """Stored messages of a range in order of their stamps; times are RFC 3339, relative as -15m, or now."""
        samples = rpc.Samples(decode=decode)
        request = rpc.query_request(robot, topics, start, end, limit=limit, newest_first=newest_first)
        async with aclosing(self._stream((await self._telemetry()).Query, request)) as replies:
            async for reply in replies:
                for sample in samples.stored(reply):
                    yield sample

    async def query(
        self, robot: str, series: Names, *, start: str = "-15m", end: str = "now", points: int = 500
    ) -> dict[str, Series]:
        """Series over a time, by name, at most so many points of each."""
        return await self._http.send(requests.series(robot, series, start=start, end=end, points=points))

    async def metrics(self, robot: str) -> list[Any]:
        """The robot's stored series, each with its newest value."""
        return await self._http.send(requests.metrics(robot))

    async def snapshot(self, robot: str) -> Any:
        """The newest message of each of the robot's topics, and its newest values."""
        return await self._http.send(requests.get(requests.robot_path(robot, "/snapshot"), dict))

    async def command(
        self,
        robot: str,
        kind: str,
        request: Mapping[str, Any] | None = None,
        *,
        wait_s: float = NO_WAIT_S,
        idempotency_key: str = "",
        **options: Any,
    ) -> Command:
        """Have a robot do something; `wait_s` for its end, at most 60. `durable=True` waits for a robot that is away.

        It carries a key by which the gateway knows it again, so that it is sent again where an answer got lost.
        """
        key = idempotency_key or uuid.uuid4().hex
        asked = requests.command(robot, kind, request or {}, key=key, wait_s=wait_s, options=options)
        return await self._http.send(asked)

    async def twin(self, robot: str) -> Any:
        """The robot's desired and reported state."""
        return await self._http.send(requests.get(requests.robot_path(robot, "/twin"), dict))

    async def change_twin(self, robot: str, patch: Mapping[str, Any]) -> Any:
        """Change the robot's own document by a JSON merge patch; what the gateway says of the change."""
        return await self._http.send(requests.merge(requests.robot_path(robot, "/twin"), dict(patch)))

    async def recordings(self, robot: str | None = None, *, limit: int = 100) -> list[Any]:
        """The newest recordings, of one robot or of all."""
        wanted = requests.get("/api/v1/recordings", lambda answer: list(answer["recordings"]), robot=robot, limit=limit)
        return await self._http.send(wanted)

    async def events(
        self, *, after: int | None = None, kinds: Names | None = None, robots: Names | None = None
    ) -> AsyncGenerator[Event, None]:
        """What happens in the fleet, from now on or behind a cursor; a loss of the connection loses none."""
        place = rpc.EventPosition(after, kinds, robots)
        async with aclosing(self._again(self._watch_events, place.request)) as replies:
            async for reply, _ in replies:
                for event in place.events(reply):
                    yield event

    @asynccontextmanager
    async def drive(self, robot: str, *, holder: str = "metaros.client") -> AsyncIterator[AsyncDrive]:
        """Drive a robot while the block runs: `drive.move(linear=…, angular=…)`. Its end stops the robot.

        Raises:
            RefusedError: `lease_taken`, where somebody else drives.
        """
        drive = AsyncDrive(robot, holder)
        call = fleet_pb2_grpc.FleetServiceStub(await self._opened()).Drive
        try:
            await drive.open(lambda requests: call(requests, metadata=self._metadata()))
            yield drive
            await drive.close()
        except grpc.RpcError as error:
            raise rpc.refusal(error) from error
        finally:
            drive.cancel()

    async def _cancel_goal(self, robot: str, goal_id: str) -> bool:
        request = telemetry_pb2.CancelGoalRequest(robot=robot, goal=goal_id)
        try:
            stub = await self._telemetry()
            answer = await stub.CancelGoal(request, metadata=self._metadata(), timeout=self._timeout_s)
        except grpc.RpcError as error:
            raise rpc.refusal(error) from error
        return bool(answer.canceling)

    async def _again(
        self, call: Callable[[], Awaitable[Any]], request: Callable[[], Any], *, decode: bool = True
    ) -> AsyncGenerator[tuple[Any, rpc.Samples], None]:
        """A stream's replies; begun again when the connection is lost, as `retries` says."""
        tries = StreamRetries(self._retries, rng=self._rng, clock=SystemClock())
        while True:
            samples = rpc.Samples(decode=decode)
            try:
                async with aclosing(self._stream(await call(), request())) as replies:
                    async for reply in replies:
                        tries.went()
                        yield reply, samples
                return
            except MetarosError as error:
                wait_s = tries.wait_s(error)
            await asyncio.sleep(wait_s)

    async def _stream(self, call: Any, request: Any) -> AsyncGenerator[Any, None]:
        """The replies of a call, whose errors are ours; leaving it ends the call."""
        replies = call(request, metadata=self._metadata())
        try:
            async for reply in replies:
                yield reply
        except grpc.RpcError as error:
            raise rpc.refusal(error) from error
        finally:
            replies.cancel()

    async def _subscribing(self) -> Any:
        return (await self._telemetry()).Subscribe

    async def _telemetry(self) -> Any:
        return telemetry_pb2_grpc.TelemetryServiceStub(await self._opened())

    async def _follow_alerts(self, request: Any) -> AsyncGenerator[Any, None]:
        async with aclosing(self._again(self._watch_alerts, lambda: request)) as replies:
            async for reply, _ in replies:
                yield reply

    async def _watch_alerts(self) -> Any:
        return alerts_pb2_grpc.AlertServiceStub(await self._opened()).WatchAlerts

    async def _watch_events(self) -> Any:
        return events_pb2_grpc.EventServiceStub(await self._opened()).WatchEvents

    def _metadata(self) -> list[tuple[str, str]]:
        return list(self.access.headers.items())

    async def _opened(self) -> grpc.aio.Channel:
        """The channel, made when it is wanted first: the gateway says on which port."""
        if self._channel is None:
            if not self._target:
                port = await self._http.send(requests.programs_port())
                self._target = f"{self.access.host}:{port}"
            self._channel = rpc.aio_channel(self.access, self._target)
        return self._channel
