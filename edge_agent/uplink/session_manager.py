"""Owner of the agent's link sessions: creates them, dispatches their events, and cleans up after each."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

from edge_agent.commands.dispatcher import CommandDispatcher
from edge_agent.commands.teleop import Teleop
from edge_agent.config.gateway_address import Compression
from edge_agent.errors import DiskError, RefusedError
from edge_agent.identity.credentials import Credentials
from edge_agent.link.frames import CommandArrived, ControlFrame, TeleopArrived
from edge_agent.link.handler import ControlHandler
from edge_agent.state.store_id import StoreId
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.session import AgentSession, Established, Event, Identity
from edge_agent.uplink.statistics import LinkFacts
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["SessionManager"]


LOG = logging.getLogger("metaros.agent.uplink")


class SessionManager:
    """The owner of all sessions of one agent process; `number` grows with each, from the start's wall time in ms."""

    def __init__(
        self,
        who: Identity,
        queues: Queues,
        teleop: Teleop,
        commands: CommandDispatcher,
        clock: Clock,
        *,
        store_id: StoreId,
        compression: Compression = "none",
        malformed: Callable[[], int],
        wake: Callable[[], None],
        credentials: Credentials | None = None,
        expired: Callable[[], None] = lambda: None,
        handlers: Sequence[ControlHandler] = (),
    ) -> None:
        self._who = who
        self._queues = queues
        self._teleop = teleop
        self._commands = commands
        self._clock = clock
        self._malformed = malformed
        self._wake = wake
        self._number = clock.wall_ns() // 1_000_000  # so that a restarted agent fences its older self
        self._store_id = store_id
        self._compression = compression
        self._credentials = credentials
        self._expired = expired
        self._handlers = handlers
        self.facts = LinkFacts()

    def new_session(self) -> AgentSession:
        """The next session, with a higher number."""
        self._number += 1
        return AgentSession(
            self._who,
            self._number,
            self._queues,
            clock=self._clock,
            store_id=self._store_id.value,
            compression=self._compression,
            malformed=self._malformed,
            facts=self.facts,
            credentials=self._credentials,
        )

    def handle(self, session: AgentSession, event: Event) -> None:
        """An event of the session that runs."""
        match event:
            case Established():
                self._store_id.learn(event.store_id)
                self._queues.outbox.online = True
                self._queues.budget.new_link(self._clock.monotonic_s())
                for handler in self._handlers:
                    handler.link_up(lambda frame: self._send_frame(session, frame), event.welcome)
            case ControlFrame():
                for handler in self._handlers:
                    if event.frame.WhichOneof("frame") in handler.frames:
                        handler.take(event)
            case TeleopArrived():
                self._teleop.drive(event)
            case CommandArrived():
                self._commands.handle(event, lambda result: self._answer(session, result))

    def session_ended(self, error: BaseException | None = None) -> None:
        """Nobody watches or drives any more: stop what moves, drop what was only for viewers."""
        self._queues.outbox.online = False
        for handler in self._handlers:
            handler.link_down()
        if isinstance(error, RefusedError) and error.reason == "forked":
            LOG.warning("another copy of this outbox has spoken to the gateway: what is held goes under a new epoch")
            try:
                self._queues.outbox.relabel()
            except DiskError as failed:  # the gateway will say so again
                LOG.error("%s", failed)
        if isinstance(error, RefusedError) and error.reason == "certificate_expired":
            self._expired()
        self._teleop.link_lost()
        self._queues.channels.demand({})
        self._queues.live.clear()

    def _send_frame(self, session: AgentSession, frame: link_pb2.AgentFrame) -> None:
        session.send_frame(frame)
        self._wake()

    def _answer(self, session: AgentSession, result: link_pb2.CommandResult) -> None:
        session.answer(result)
        self._wake()
