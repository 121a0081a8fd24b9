"""Teleop at the robot: the shell around the guards that publishes, and stops what has to stop, on the event loop.

Driving and talking have a lease each; the topic says which of them is needed.
"""

from __future__ import annotations

import asyncio
import logging

from edge_agent.commands.drive_watchdog import DriveGuard
from edge_agent.commands.publishers import Publishers, zero_message
from edge_agent.commands.talk_watchdog import TalkGuard
from edge_agent.errors import LeaseError, ScopeError, StaleError
from edge_agent.forwarding.scope import Scope
from edge_agent.link.frames import TeleopArrived
from metaros._proto import link_pb2
from metaros.errors import MetarosError

__all__ = ["Teleop"]

LOG = logging.getLogger("metaros.agent.teleop")


class Teleop:
    """Every remote path to an actuator passes here."""

    def __init__(self, guard: DriveGuard, talk: TalkGuard, publishers: Publishers, scope: Scope) -> None:
        self._guard = guard
        self._talk = talk
        self._publishers = publishers
        self._scope = scope
        self._stops: dict[str, tuple[str, str, bytes]] = {}  # topic -> type, hash, zero message
        self._changed = asyncio.Event()
        self.refused: dict[str, int] = {}

    def drive(self, event: TeleopArrived) -> None:
        """Publish a drive command or speech if lease, age and order allow it; refusals are counted, not answered."""
        teleop = event.teleop
        if not self._scope.includes(teleop.topic):
            self._refuse("out_of_scope")
            return
        try:
            zero = zero_message(teleop.type_name)
            guard = self._guard_of(teleop.topic)
            if guard is self._talk and guard.holds(teleop.lease_id):  # whoever has no lease uses up none of its rate
                self._talk.admit(teleop.type_name, teleop.payload)
            verdict = guard.accept(teleop.topic, teleop.lease_id, teleop.seq, event.age_s)
            if verdict:
                self._refuse(verdict)
                return
            self._publishers.publish(teleop.topic, teleop.type_name, teleop.type_hash, teleop.payload)
        except MetarosError as error:
            self._refuse(error.code)
            return
        self._moving(teleop.topic, teleop.type_name, teleop.type_hash, zero)

    def is_actuator(self, name: str) -> bool:
        """Whether publishing on that topic, or calling that service, moves the robot, or is its voice."""
        return self._guard.is_actuator(name) or self._talk.is_actuator(name)

    def check(self, name: str, lease_id: str, *, age_s: float | None) -> None:
        """Return where the name is no actuator, or lease and age let it be used; `age_s` None is of unknown age.

        Raises:
            LeaseError: an actuator without the current lease.
            StaleError: the command is older than what may still move the robot.
        """
        if not self.is_actuator(name):
            return
        guard = self._guard_of(name)
        if not guard.holds(lease_id):
            kind = "talk" if guard is self._talk else "teleop"
            raise LeaseError(f"{name} is an actuator: take the {kind} lease first")
        if age_s is None or age_s > guard.fresh_s:
            age = "of unknown age" if age_s is None else f"{age_s:.3f} s old"
            raise StaleError(f"{name} is an actuator, and this is {age}: at most {guard.fresh_s:g} s may be")

    def publish(self, message: link_pb2.PublishMessage, lease_id: str, *, age_s: float | None = None) -> None:
        """Publish a command's message; on an actuator only under the lease, and while it is fresh.

        Raises:
            ScopeError: the topic is not this robot's.
            LeaseError, StaleError: see `check`.
            PacketError: no packet of speech.
            UsageError: topic, type or hash is not what ROS 2 allows.
        """
        if not self._scope.includes(message.topic):
            raise ScopeError(f"{message.topic} is outside the agent's namespace {self._scope.namespace}")
        self.check(message.topic, lease_id, age_s=age_s)
        if not self.is_actuator(message.topic):
            self._publishers.publish(message.topic, message.type_name, message.type_hash, message.payload)
            return
        guard = self._guard_of(message.topic)
        if guard is self._talk:
            self._talk.admit(message.type_name, message.payload)
        zero = zero_message(message.type_name)
        self._publishers.publish(message.topic, message.type_name, message.type_hash, message.payload)
        guard.drove(message.topic)
        self._moving(message.topic, message.type_name, message.type_hash, zero)

    def grant(self, lease_id: str, valid_s: float) -> None:
        """The gateway gives somebody the lease to drive."""
        self._stop(self._guard.grant(lease_id, valid_s))

    def grant_talk(self, lease_id: str, valid_s: float) -> None:
        """The gateway gives somebody the lease to talk; TalkOffError."""
        self._stop(self._talk.grant(lease_id, valid_s))

    def release(self, lease_id: str) -> None:
        """The gateway takes a lease back, whichever it is."""
        self._stop([*self._guard.release(lease_id), *self._talk.release(lease_id)])

    def link_lost(self) -> None:
        """Stop everything: nobody can say stop any more."""
        self._stop([*self._guard.lost(), *self._talk.lost()])

    async def run(self) -> None:
        """Watch until cancelled; what still moves then is stopped."""
        try:
            while True:
                self._changed.clear()
                try:
                    waits_s = [wait_s for guard in (self._guard, self._talk) if (wait_s := guard.wait_s()) is not None]
                    await asyncio.wait_for(self._changed.wait(), min(waits_s, default=None))
                except TimeoutError:
                    self._stop([*self._guard.due(), *self._talk.due()])
        finally:
            self.link_lost()

    def _guard_of(self, name: str) -> DriveGuard:
        return self._talk if self._talk.is_actuator(name) else self._guard

    def _moving(self, topic: str, type_name: str, type_hash: str, zero: bytes) -> None:
        self._stops[topic] = (type_name, type_hash, zero)
        self._changed.set()

    def _stop(self, topics: list[str]) -> None:
        for topic in topics:
            type_name, type_hash, zero = self._stops.pop(topic)
            LOG.info("stopping %s", topic)
            self._publishers.publish(topic, type_name, type_hash, zero)

    def _refuse(self, reason: str) -> None:
        if reason not in self.refused:
            LOG.warning("refused a drive command: %s", reason)
        self.refused[reason] = self.refused.get(reason, 0) + 1
