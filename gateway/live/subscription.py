"""One subscription of one viewer to topics: which samples pass, and what waits for the next write. Pure."""

from __future__ import annotations

from collections import deque

from gateway.domain.channel import Channel
from gateway.domain.records import Record
from gateway.live.scope import RobotPattern
from metaros.idl.globs import Glob

__all__ = ["TopicSubscription"]

Entry = tuple[int, Record]  # channel number on this connection, record


class TopicSubscription:
    """Mode "latest": of each channel only the newest waits. Mode "queue": in order, the oldest dropped when full."""

    def __init__(
        self, number: int, robots: RobotPattern, topics: Glob, *, max_rate_hz: float, latest: bool, queue_bytes: int
    ) -> None:
        self.number = number
        self.max_rate_hz = max_rate_hz
        self.latest = latest
        self.size_bytes = 0
        self.dropped = 0
        self.reported = 0
        self._robots = robots
        self._topics = topics
        self._queue_bytes = queue_bytes
        self._interval_s = 1.0 / max_rate_hz if max_rate_hz > 0 else 0.0
        self._queue: deque[Entry] = deque()
        self._newest: dict[int, Record] = {}
        self._due_s: dict[int, float] = {}
        self._last_stamp_ns: dict[int, int] = {}

    def matches(self, robot: str, topic: str) -> bool:
        """Whether it wants that topic of that robot."""
        return self._robots.matches(robot) and self._topics.matches(topic)

    def wants(self, channel: Channel) -> bool:
        """Whether it wants that channel."""
        return self.matches(channel.robot, channel.topic)

    def offer(self, channel: int, record: Record) -> int:
        """Take a sample in, if its turn has come; returns by how many bytes the waiting data grew (or shrank)."""
        before = self.size_bytes
        if self.latest:
            replaced = self._newest.pop(channel, None)
            if replaced is not None:
                self.size_bytes -= replaced.size_bytes
            self._newest[channel] = record
            self.size_bytes += record.size_bytes
        elif self._passes(channel, record.stamp_ns):
            self._queue.append((channel, record))
            self.size_bytes += record.size_bytes
            while self.size_bytes > self._queue_bytes and len(self._queue) > 1:
                self.drop_oldest()
        return self.size_bytes - before

    def take(self, now_s: float) -> Entry | None:
        """The next record that may go out now."""
        if self.latest:
            for channel in self._newest:
                if self._due_s.get(channel, 0.0) <= now_s:
                    record = self._newest.pop(channel)
                    self.size_bytes -= record.size_bytes
                    if self._interval_s:
                        due_s = self._due_s.get(channel, 0.0) + self._interval_s
                        self._due_s[channel] = due_s if due_s > now_s else now_s + self._interval_s
                    return channel, record
            return None
        if not self._queue:
            return None
        entry = self._queue.popleft()
        self.size_bytes -= entry[1].size_bytes
        return entry

    def due_s(self) -> float | None:
        """When `take` will have something; None while nothing waits."""
        if self._queue:
            return 0.0
        return min((self._due_s.get(channel, 0.0) for channel in self._newest), default=None)

    def drop_oldest(self) -> int:
        """Give the oldest waiting record up; returns its bytes."""
        if self._queue:
            size_bytes = self._queue.popleft()[1].size_bytes
        elif self._newest:
            size_bytes = self._newest.pop(next(iter(self._newest))).size_bytes
        else:
            return 0
        self.size_bytes -= size_bytes
        self.dropped += 1
        return size_bytes

    def _passes(self, channel: int, stamp_ns: int) -> bool:
        """Thin a queue by the samples' own stamps, so that a burst of a steady topic stays steady."""
        if not self._interval_s:
            return True
        last_ns = self._last_stamp_ns.get(channel)
        if last_ns is not None and last_ns <= stamp_ns < last_ns + self._interval_s * 0.999e9:
            return False
        self._last_stamp_ns[channel] = stamp_ns
        return True
