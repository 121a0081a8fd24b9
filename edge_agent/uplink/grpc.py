"""The link over gRPC: one channel and one bidirectional stream a lane; a thin shell around AgentSession.

Each lane has a connection of its own with a reader and a writer task, so control never waits behind data.
A write waits for HTTP/2 flow control, which is the back-pressure. Any lane's end is the session's end.
"""

from __future__ import annotations

import asyncio
import logging
from typing import Any, Protocol

import grpc
import grpc.aio

from edge_agent.errors import DiskError, LinkError, RefusedError
from edge_agent.uplink.backoff import Backoff
from edge_agent.uplink.session import LANES, AgentSession, Established, Event
from metaros._proto import link_pb2
from metaros.errors import FrameError
from metaros.limits import LIMITS

__all__ = ["GrpcUplink", "SessionOwner"]

LOG = logging.getLogger("metaros.agent.uplink")
OPEN_S = 5.0
CHECK_S = 0.5
OPTIONS = (
    ("grpc.use_local_subchannel_pool", 1),  # a connection of its own for each lane
    ("grpc.enable_retries", 0),
    ("grpc.keepalive_time_ms", round(LIMITS.heartbeat_s * 1000)),
    ("grpc.keepalive_timeout_ms", round((LIMITS.dead_after_s - LIMITS.heartbeat_s) * 1000)),
    ("grpc.http2.max_pings_without_data", 0),
    ("grpc.max_receive_message_length", LIMITS.frame_bytes),
    ("grpc.max_send_message_length", LIMITS.frame_bytes),
)


class SessionOwner(Protocol):
    """What the agent gives a transport: sessions, and a place for their events."""

    def new_session(self) -> AgentSession:
        """The next session, with a higher number."""

    def handle(self, session: AgentSession, event: Event) -> None:
        """An event of the session that runs."""

    def session_ended(self, error: BaseException | None = None) -> None:
        """The session is over, and why; whatever hung on it stops."""


class GrpcUplink:
    """Keeps a session up: connects, runs it, waits, again."""

    def __init__(self, target: str, owner: SessionOwner, backoff: Backoff) -> None:
        self._target = target
        self._owner = owner
        self._backoff = backoff
        self._wakes = {lane: asyncio.Event() for lane in LANES}
        self._said = ""

    def wake(self) -> None:
        """There may be something to send."""
        for wake in self._wakes.values():
            wake.set()

    async def run(self) -> None:
        """Until cancelled."""
        while True:
            delay_s = 0.0
            try:
                await self._one_session(self._owner.new_session())
            except RefusedError as error:
                delay_s = error.retry_after_s
                self._say(f"link down: {error}")
            except (LinkError, DiskError, FrameError, grpc.RpcError, TimeoutError) as error:
                self._say(f"link down: {describe(error)}")
            await asyncio.sleep(max(delay_s, self._backoff.next_s()))

    async def _one_session(self, session: AgentSession) -> None:
        """Run a session in a task of its own, so that our end and a lane's end in one moment stay two things."""
        task = asyncio.create_task(self._run_session(session))
        try:
            await asyncio.wait({task})
        finally:
            task.cancel()
            await asyncio.wait({task})
            self._owner.session_ended(None if task.cancelled() else task.exception())
        await task

    async def _run_session(self, session: AgentSession) -> None:
        """Open all lanes and run them; always raises, with the first reason."""
        channels: list[grpc.aio.Channel] = []
        calls: dict[link_pb2.Lane, Any] = {}
        try:
            for lane in LANES:
                channels.append(grpc.aio.insecure_channel(self._target, options=OPTIONS))
                calls[lane] = open_stream(channels[-1])
                async with asyncio.timeout(OPEN_S):
                    await write(calls[lane], session.hello(lane).SerializeToString())
                    await self._read_one(session, lane, calls[lane])
            await self._run_lanes(session, calls)
        finally:
            for call in calls.values():
                call.cancel()
            for channel in channels:
                await channel.close()

    async def _run_lanes(self, session: AgentSession, calls: dict[link_pb2.Lane, Any]) -> None:
        try:
            async with asyncio.TaskGroup() as group:
                for lane, call in calls.items():
                    group.create_task(self._read(session, lane, call))
                    group.create_task(self._write(session, lane, call))
                group.create_task(self._check(session))
        except BaseExceptionGroup as errors:
            raise first_reason(errors) from None

    async def _read(self, session: AgentSession, lane: link_pb2.Lane, call: Any) -> None:
        while True:
            await self._read_one(session, lane, call)

    async def _read_one(self, session: AgentSession, lane: link_pb2.Lane, call: Any) -> None:
        frame = await call.read()
        if frame is grpc.aio.EOF:
            raise LinkError("the gateway ended the stream")
        for event in session.receive(lane, frame):
            if isinstance(event, Established):
                self._backoff.reset()
                self._say(f"link up: gateway {event.gateway_id} at {self._target}")
            self._owner.handle(session, event)
        self.wake()

    async def _write(self, session: AgentSession, lane: link_pb2.Lane, call: Any) -> None:
        wake = self._wakes[lane]
        while True:
            wake.clear()
            while (frame := session.next_frame(lane)) is not None:
                await write(call, frame)
            try:
                async with asyncio.timeout(session.wait_s(lane)):
                    await wake.wait()
            except TimeoutError:
                continue

    async def _check(self, session: AgentSession) -> None:
        while True:
            await asyncio.sleep(CHECK_S)
            session.check()

    def _say(self, text: str) -> None:
        """Log a change of the link's state, not every repeated failure."""
        if text != self._said:
            LOG.info("%s", text)
        self._said = text


def open_stream(channel: grpc.aio.Channel) -> Any:
    """`Link.Connect` with frames that are serialised already: most of them were packed when they were accepted."""
    return channel.stream_stream(
        "/metaros.v1.Link/Connect",
        request_serializer=bytes,
        response_deserializer=link_pb2.GatewayFrame.FromString,
    )()


async def write(call: Any, frame: bytes) -> None:
    """Write a frame; a stream that has ended is a LinkError."""
    try:
        await call.write(frame)
    except asyncio.InvalidStateError as error:
        raise LinkError("the stream ended") from error


def first_reason(errors: BaseExceptionGroup[BaseException]) -> BaseException:
    """The most telling of the errors that ended a session: a goodbye before a status before a broken stream."""
    flat = errors.exceptions
    ranked = (RefusedError, grpc.RpcError, FrameError, LinkError)
    return next((error for kind in ranked for error in flat if isinstance(error, kind)), flat[0])


def describe(error: Exception) -> str:
    """One line about a failed link."""
    if isinstance(error, grpc.aio.AioRpcError):
        return f"{error.code().name.lower()}: {error.details()}"
    return str(error) or type(error).__name__
