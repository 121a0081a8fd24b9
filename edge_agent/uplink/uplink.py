"""Keeps a session up: finds a gateway and a transport, runs three lanes, waits, again.

Each lane is a connection of its own with a reader and a writer task, so control never waits behind data. A write that
waits is the back-pressure. Any lane's end is the session's end.
"""

from __future__ import annotations

import asyncio
import functools
import logging
from collections import deque
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Final, Protocol

from edge_agent.config.gateway_address import GatewayAddress, TransportName
from edge_agent.errors import BehindError, DiskError, LinkError, RefusedError
from edge_agent.identity.credentials import Credentials
from edge_agent.uplink.backoff import Backoff
from edge_agent.uplink.gateway_selector import GatewaySelector
from edge_agent.uplink.grpc import open_grpc
from edge_agent.uplink.reachability import wait_reachable
from edge_agent.uplink.session import LANES, AgentSession, Event
from edge_agent.uplink.statistics import LinkFacts
from edge_agent.uplink.transport import Connection, OpenLane
from edge_agent.uplink.websocket import open_websocket
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import FrameError

__all__ = ["TRANSPORTS", "SessionOwner", "Uplink", "transports_with"]

LOG = logging.getLogger("metaros.agent.uplink")
OPEN_S = 5.0
# Times OPEN_S after answers that did not come: in a fleet that returns all at once the gateway has a queue, and who
# leaves it every five seconds begins at its end again.
MOST_PATIENCE = 4
REMEMBERED_LINES = 8
CHECK_S = 0.25
STEADY_S = 1.0  # a session that lasted so long was a good one: the next attempt comes at once
LAST_WORDS_S = 0.5  # how long a failed writer waits for the reader to find out why
TRANSPORTS: Final[Mapping[TransportName, OpenLane]] = {"grpc": open_grpc, "websocket": open_websocket}
# Goodbyes that somebody has to do something about.
TO_BE_SEEN: Final = frozenset(
    {
        *("other_store", "not_enrolled", "proof_refused", "clone_detected"),
        *("certificate_expired", "certificate_revoked", "certificate_foreign"),
    }
)


def transports_with(credentials: Credentials | None) -> Mapping[TransportName, OpenLane]:
    """Both transports, with the robot's identity where it has one."""
    if credentials is None:
        return TRANSPORTS
    return {
        "grpc": functools.partial(open_grpc, shown=credentials),
        "websocket": functools.partial(open_websocket, shown=credentials),
    }


class SessionOwner(Protocol):
    """What the agent gives the uplink: sessions, and a place for their events."""

    facts: LinkFacts

    def new_session(self) -> AgentSession:
        """The next session, with a higher number."""

    def handle(self, session: AgentSession, event: Event) -> None:
        """An event of the session that runs."""

    def session_ended(self, error: BaseException | None = None) -> None:
        """The session is over, and why; whatever hung on it stops."""


class Uplink:
    """Sessions one after the other, by the first gateway and transport of those given that work."""

    def __init__(
        self,
        gateways: Sequence[GatewayAddress],
        owner: SessionOwner,
        backoff: Backoff,
        clock: Clock,
        *,
        transports: Mapping[TransportName, OpenLane] = TRANSPORTS,
        wait_reachable: Callable[[GatewayAddress], Awaitable[None]] = wait_reachable,
    ) -> None:
        self._choice = GatewaySelector(gateways, clock)
        self._owner = owner
        self._backoff = backoff
        self._clock = clock
        self._transports = transports
        self._reach = wait_reachable
        self._wakes = {lane: asyncio.Event() for lane in LANES}
        self._up_since_s: float | None = None
        self._ups = 0
        self._patience = 1
        self._unanswered = False
        self._said: deque[str] = deque(maxlen=REMEMBERED_LINES)

    def wake(self, *lanes: link_pb2.Lane) -> None:
        """There may be something to send, on these lanes or any."""
        for lane in lanes or LANES:
            self._wakes[lane].set()

    async def run(self) -> None:
        """Until cancelled."""
        while True:
            await self._attempt()
            await asyncio.sleep(max(self._choice.hold_s(), self._backoff.next_s()))

    async def _attempt(self) -> None:
        """One gateway: find it, bring up a session, run it to its end, and conclude what comes next."""
        gateway = self._choice.gateway
        self._up_since_s, self._unanswered = None, False
        try:
            await self._reach(gateway)
            await self._by_some_transport(gateway)
        except RefusedError as error:
            self._say(f"link down: {gateway.text}: {error}", refused=error.reason in TO_BE_SEEN)
            self._choice.refused(error.reason, error.retry_after_s)
        except (LinkError, DiskError, FrameError) as error:
            self._say(f"link down: {gateway.text}: {error}")
            if not self._was_up() and not isinstance(error, (BehindError, DiskError)):
                self._choice.failed()
        self._patience = min(2 * self._patience, MOST_PATIENCE) if self._unanswered else 1
        if self._was_up(for_s=STEADY_S):
            self._backoff.reset()

    async def _by_some_transport(self, gateway: GatewayAddress) -> None:
        """Run a session by the first transport that brings one up; always raises."""
        failures: list[str] = []
        for transport in self._choice.transports():
            try:
                await self._one_session(gateway, transport)
            except (RefusedError, BehindError):
                raise
            except LinkError as error:
                if self._was_up():
                    raise
                failures.append(f"{transport}: {error}")
        raise LinkError("; ".join(failures))

    async def _one_session(self, gateway: GatewayAddress, transport: TransportName) -> None:
        """Run a session in a task of its own, so that our end and a lane's end in one moment stay two things."""
        session = self._owner.new_session()
        task = asyncio.create_task(self._run_session(session, gateway, transport))
        try:
            await asyncio.wait({task})
        finally:
            task.cancel()
            await asyncio.wait({task})
            self._owner.session_ended(None if task.cancelled() else task.exception())
        await task

    async def _run_session(self, session: AgentSession, gateway: GatewayAddress, transport: TransportName) -> None:
        """Open all lanes and run them; always raises, with the first reason."""
        lanes: dict[link_pb2.Lane, Connection] = {}
        try:
            for lane in LANES:
                await self._open(session, lane, lanes, gateway, transport)
            await self._run_lanes(session, lanes)
        finally:
            await asyncio.gather(*(connection.close() for connection in lanes.values()))

    async def _open(
        self,
        session: AgentSession,
        lane: link_pb2.Lane,
        lanes: dict[link_pb2.Lane, Connection],
        gateway: GatewayAddress,
        transport: TransportName,
    ) -> None:
        """Connect a lane, from Hello over a proof where one is asked to Welcome; the last establishes the session."""
        try:
            async with asyncio.timeout(OPEN_S * self._patience):
                connection = lanes[lane] = await self._transports[transport](gateway)
                hello = session.hello(lane)
                await connection.write(hello.SerializeToString())
                frame = await connection.read()
                if frame.HasField("challenge"):
                    await connection.write(session.prove(hello, frame.challenge).SerializeToString())
                    frame = await connection.read()
        except TimeoutError:
            self._unanswered = True
            raise LinkError(f"no answer within {OPEN_S * self._patience:g} s") from None
        self._take(session, lane, frame)
        if not session.established:
            return
        facts, self._ups = self._owner.facts, self._ups + 1
        facts.transport, facts.gateway, facts.reconnects = transport, gateway.text, self._ups - 1
        self._up_since_s, self._unanswered = self._clock.monotonic_s(), False
        self._choice.worked(transport)
        self._said.clear()
        self._say(f"link up: gateway {session.gateway_id} at {gateway.text} by {transport}")

    async def _run_lanes(self, session: AgentSession, lanes: Mapping[link_pb2.Lane, Connection]) -> None:
        try:
            async with asyncio.TaskGroup() as group:
                for lane, connection in lanes.items():
                    group.create_task(self._read(session, lane, connection))
                    group.create_task(self._write(session, lane, connection))
                group.create_task(self._check(session))
        except BaseExceptionGroup as errors:
            raise first_reason(errors) from None

    async def _read(self, session: AgentSession, lane: link_pb2.Lane, connection: Connection) -> None:
        while True:
            self._take(session, lane, await connection.read())

    def _take(self, session: AgentSession, lane: link_pb2.Lane, frame: link_pb2.GatewayFrame) -> None:
        for event in session.receive(lane, frame):
            self._owner.handle(session, event)
        self.wake()

    async def _write(self, session: AgentSession, lane: link_pb2.Lane, connection: Connection) -> None:
        wake, loop = self._wakes[lane], asyncio.get_running_loop()
        while True:
            wake.clear()
            while (frame := session.next_frame(lane)) is not None:
                try:
                    await connection.write(frame)
                except LinkError:  # a gateway that says goodbye also ends the lane: its reason is the better one
                    await asyncio.sleep(LAST_WORDS_S)
                    raise
            wait_s = session.wait_s(lane)
            timer = loop.call_later(wait_s, wake.set) if wait_s is not None else None
            try:
                await wake.wait()
            finally:
                if timer is not None:
                    timer.cancel()

    async def _check(self, session: AgentSession) -> None:
        while True:
            await asyncio.sleep(CHECK_S)
            session.check()

    def _was_up(self, *, for_s: float = 0.0) -> bool:
        """Whether this attempt brought a session up, at least so long ago."""
        return self._up_since_s is not None and self._clock.monotonic_s() - self._up_since_s >= for_s

    def _say(self, text: str, *, refused: bool = False) -> None:
        """Log a change of the link's state, not every repeated failure."""
        if text not in self._said:
            LOG.log(logging.WARNING if refused else logging.INFO, "%s", text)
            self._said.append(text)


def first_reason(errors: BaseExceptionGroup[BaseException]) -> BaseException:
    """The most telling of the errors that ended a session: a goodbye before a broken stream."""
    flat = errors.exceptions
    ranked = (RefusedError, DiskError, FrameError, LinkError)
    return next((error for kind in ranked for error in flat if isinstance(error, kind)), flat[0])
