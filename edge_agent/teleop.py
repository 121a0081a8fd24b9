"""Teleop at the robot: the shell around DriveGuard that publishes, and stops what has to stop, on the event loop."""

from __future__ import annotations

import asyncio
import logging

from edge_agent.drive_guard import DriveGuard
from edge_agent.errors import LeaseError, ScopeError, StaleError
from edge_agent.publishers import Publishers, zero_message
from edge_agent.scope import Scope
from edge_agent.uplink.session import TeleopArrived
from metaros._proto import link_pb2
from metaros.errors import MetarosError

__all__ = ["Teleop"]

LOG = logging.getLogger("metaros.agent.teleop")


class Teleop:
    """Every way from afar to an actuator passes here."""

    def __init__(self, guard: DriveGuard, publishers: Publishers, scope: Scope) -> None:
        self._guard = guard
        self._publishers = publishers
        self._scope = scope
        self._stops: dict[str, tuple[str, str, bytes]] = {}  # topic -> type, hash, zero message
        self._changed = asyncio.Event()
        self.refused: dict[str, int] = {}

    def drive(self, event: TeleopArrived) -> None:
        """Publish a drive command if lease, age and order allow it; refusals are counted, not answered."""
        teleop = event.teleop
        if not self._scope.includes(teleop.topic):
            self._refuse("out_of_scope")
            return
        try:
            zero = zero_message(teleop.type_name)
            verdict = self._guard.accept(teleop.topic, teleop.lease_id, teleop.seq, event.age_s)
            if verdict:
                self._refuse(verdict)
                return
            self._publishers.publish(teleop.topic, teleop.type_name, teleop.type_hash, teleop.payload)
        except MetarosError as error:
            self._refuse(error.code)
            return
        self._moving(teleop.topic, teleop.type_name, teleop.type_hash, zero)

    def is_actuator(self, name: str) -> bool:
        """Whether publishing on that topic, or calling that service, moves the robot."""
        return self._guard.is_actuator(name)

    def check(self, name: str, lease_id: str, *, age_s: float | None) -> None:
        """Return where the name is no actuator, or lease and age let it be used; `age_s` None is of unknown age.

        Raises:
            LeaseError: an actuator without the current lease.
            StaleError: the command is older than what may still move the robot.
        """
        if not self._guard.is_actuator(name):
            return
        if not self._guard.holds(lease_id):
            raise LeaseError(f"{name} is an actuator: take the teleop lease first")
        if age_s is None or age_s > self._guard.fresh_s:
            told = "of unknown age" if age_s is None else f"{age_s:.3f} s old"
            raise StaleError(f"{name} is an actuator, and this is {told}: at most {self._guard.fresh_s:g} s may be")

    def publish(self, message: link_pb2.PublishMessage, lease_id: str, *, age_s: float | None = None) -> None:
        """Publish a command's message; on an actuator only under the lease, and while it is fresh.

        Raises:
            ScopeError: the topic is not this robot's.
            LeaseError, StaleError: see `check`.
            UsageError: topic, type or hash is not what ROS 2 allows.
        """
        if not self._scope.includes(message.topic):
            raise ScopeError(f"{message.topic} is outside the agent's namespace {self._scope.namespace}")
        self.check(message.topic, lease_id, age_s=age_s)
        if not self._guard.is_actuator(message.topic):
            self._publishers.publish(message.topic, message.type_name, message.type_hash, message.payload)
            return
        zero = zero_message(message.type_name)
        self._publishers.publish(message.topic, message.type_name, message.type_hash, message.payload)
        self._guard.drove(message.topic)
        self._moving(message.topic, message.type_name, message.type_hash, zero)

    def grant(self, lease_id: str, valid_s: float) -> None:
        """The gateway gives somebody the lease."""
        self._stop(self._guard.grant(lease_id, valid_s))

    def release(self, lease_id: str) -> None:
        """The gateway takes the lease back."""
        self._stop(self._guard.release(lease_id))

    def link_lost(self) -> None:
        """Stop everything: nobody can say stop any more."""
        self._stop(self._guard.lost())

    async def run(self) -> None:
        """Watch until cancelled; what still moves then is stopped."""
        try:
            while True:
                self._changed.clear()
                try:
                    await asyncio.wait_for(self._changed.wait(), self._guard.wait_s())
                except TimeoutError:
                    self._stop(self._guard.due())
        finally:
            self.link_lost()

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
