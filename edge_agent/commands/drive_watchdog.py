"""The agent's watchdog over what moves: lease, newest wins, age, and a stop when commands cease. Pure.

An actuator that was driven is stopped (its topic is returned for a zero message, once) when no fresh command came for
`fresh_s`, when the lease is released, replaced or runs out, and when the link is lost. After that it stays quiet, so
that the robot's own programs can drive again.
"""

from __future__ import annotations

from collections.abc import Iterable

from edge_agent.config.topic_table import DEFAULT_ACTUATORS
from metaros.clock import Clock
from metaros.idl.globs import Glob
from metaros.limits import LIMITS

__all__ = ["DriveGuard"]


class DriveGuard:
    """One robot's lease and its driven actuators."""

    def __init__(
        self, clock: Clock, actuators: Iterable[str] = DEFAULT_ACTUATORS, *, fresh_s: float = LIMITS.teleop_fresh_s
    ) -> None:
        self._clock = clock
        self._actuators = tuple(Glob(pattern) for pattern in actuators)
        self.fresh_s = fresh_s
        self._lease_id = ""
        self._valid_s = 0.0
        self._expires_s = 0.0
        self._newest_seq = 0
        self._driven: dict[str, float] = {}  # topic -> when its last fresh command came

    def is_actuator(self, topic: str) -> bool:
        """Whether publishing on the topic, or calling the service, needs the lease."""
        return any(glob.matches(topic) for glob in self._actuators)

    def grant(self, lease_id: str, valid_s: float) -> list[str]:
        """A new lease, or more time for the current one; topics to stop because another holder loses them."""
        stop = self.lost() if lease_id != self._lease_id else []
        self._lease_id = lease_id
        self._valid_s = valid_s if valid_s > 0 else LIMITS.lease_s
        self._expires_s = self._clock.monotonic_s() + self._valid_s
        return stop

    def release(self, lease_id: str) -> list[str]:
        """The holder gives the lease back; topics to stop."""
        return self.lost() if lease_id == self._lease_id else []

    def holds(self, lease_id: str) -> bool:
        """Whether that is the current lease."""
        return bool(lease_id) and lease_id == self._lease_id and self._clock.monotonic_s() < self._expires_s

    def accept(self, topic: str, lease_id: str, seq: int, age_s: float) -> str:
        """Check a drive command: "" = publish it, else why not: no_lease, stale, old."""
        if not self.holds(lease_id):
            return "no_lease"
        if age_s > self.fresh_s:
            return "stale"
        if seq <= self._newest_seq:
            return "old"
        self._newest_seq = seq
        self.drove(topic)
        return ""

    def drove(self, topic: str) -> None:
        """A command under the lease went to the actuator: it renews both watchdogs."""
        now_s = self._clock.monotonic_s()
        self._expires_s = max(self._expires_s, now_s + self._valid_s)
        self._driven[topic] = now_s

    def due(self) -> list[str]:
        """Topics to stop now, each reported once."""
        now_s = self._clock.monotonic_s()
        if self._lease_id and now_s >= self._expires_s:
            return self.lost()
        stop = [topic for topic, last_s in self._driven.items() if now_s >= last_s + self.fresh_s]
        for topic in stop:
            del self._driven[topic]
        return stop

    def lost(self) -> list[str]:
        """The link or the lease is gone; topics to stop."""
        stop = list(self._driven)
        self._driven.clear()
        self._lease_id, self._newest_seq = "", 0
        return stop

    def wait_s(self) -> float | None:
        """Seconds until `due` may have something, None while nothing moves."""
        if not self._driven:
            return None
        first_s = min(min(self._driven.values()) + self.fresh_s, self._expires_s)
        return max(0.0, first_s - self._clock.monotonic_s())
