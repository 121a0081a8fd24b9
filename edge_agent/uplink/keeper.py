"""Sessions one after the other: makes them, hands their events on, and cleans up after each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from edge_agent.batch import Linger
from edge_agent.channels import Channels
from edge_agent.commands import Commands
from edge_agent.live import LiveQueue
from edge_agent.outbox import Outbox
from edge_agent.teleop import Teleop
from edge_agent.uplink.session import AgentSession, CommandArrived, Established, Event, Identity, TeleopArrived
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["Queues", "SessionKeeper"]


@dataclass(frozen=True, slots=True)
class Queues:
    """What is known of the robot's topics, and what of them waits for the link."""

    channels: Channels
    outbox: Outbox
    live: LiveQueue
    linger: Linger


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
        malformed: Callable[[], int],
        wake: Callable[[], None],
    ) -> None:
        self._who = who
        self._queues = queues
        self._teleop = teleop
        self._commands = commands
        self._clock = clock
        self._malformed = malformed
        self._wake = wake
        self._number = clock.wall_ns() // 1_000_000  # so that a restarted agent fences its older self
        self._store_id = ""

    def new_session(self) -> AgentSession:
        """The next session, with a higher number."""
        self._number += 1
        return AgentSession(
            self._who,
            self._number,
            channels=self._queues.channels,
            outbox=self._queues.outbox,
            live=self._queues.live,
            linger=self._queues.linger,
            clock=self._clock,
            store_id=self._store_id,
            malformed=self._malformed,
        )

    def handle(self, session: AgentSession, event: Event) -> None:
        """An event of the session that runs."""
        match event:
            case Established():
                self._store_id = event.store_id
            case TeleopArrived():
                self._teleop.drive(event)
            case CommandArrived():
                self._commands.handle(event, lambda result: self._answer(session, result))

    def session_ended(self) -> None:
        """Nobody watches or drives any more: stop what moves, drop what was only for viewers."""
        self._teleop.link_lost()
        self._queues.channels.demand({})
        self._queues.live.clear()

    def _answer(self, session: AgentSession, result: link_pb2.CommandResult) -> None:
        session.answer(result)
        self._wake()
