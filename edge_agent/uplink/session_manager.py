"""Sessions one after the other: makes them, hands their events on, and cleans up after each."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

from edge_agent.commands import Commands
from edge_agent.errors import DiskError, RefusedError
from edge_agent.identity.credentials import Credentials
from edge_agent.store_id import StoreId
from edge_agent.teleop import Teleop
from edge_agent.uplink.desk import LinkDesk, Told
from edge_agent.uplink.lane import Compression
from edge_agent.uplink.session import (
    AgentSession,
    CommandArrived,
    Established,
    Event,
    Identity,
    Queues,
    TeleopArrived,
)
from edge_agent.uplink.statistics import LinkFacts
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["SessionKeeper"]


LOG = logging.getLogger("metaros.agent.uplink")


class SessionKeeper:
    """The owner of all sessions of one agent process; `number` grows with each, from the start's wall time in ms."""

    def __init__(
        self,
        who: Identity,
        queues: Queues,
        teleop: Teleop,
        commands: Commands,
        clock: Clock,
        *,
        store_id: StoreId,
        compression: Compression = "none",
        malformed: Callable[[], int],
        wake: Callable[[], None],
        credentials: Credentials | None = None,
        expired: Callable[[], None] = lambda: None,
        desks: Sequence[LinkDesk] = (),
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
        self._desks = desks
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
                for desk in self._desks:
                    desk.link_up(lambda frame: self._tell(session, frame), event.welcome)
            case Told():
                for desk in self._desks:
                    if event.frame.WhichOneof("frame") in desk.frames:
                        desk.take(event)
            case TeleopArrived():
                self._teleop.drive(event)
            case CommandArrived():
                self._commands.handle(event, lambda result: self._answer(session, result))

    def session_ended(self, error: BaseException | None = None) -> None:
        """Nobody watches or drives any more: stop what moves, drop what was only for viewers."""
        self._queues.outbox.online = False
        for desk in self._desks:
            desk.link_down()
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

    def _tell(self, session: AgentSession, frame: link_pb2.AgentFrame) -> None:
        session.tell(frame)
        self._wake()

    def _answer(self, session: AgentSession, result: link_pb2.CommandResult) -> None:
        session.answer(result)
        self._wake()
