"""The samples of one channel that all subscriptions of one kind get: every one, the newest of a tick, or paced. Pure.

All subscriptions with the same channel, mode and rate share a selection, so which samples pass is decided once, and
what passes is one block for all of them.
"""

from __future__ import annotations

from collections.abc import Iterator

from gateway.domain.channel import Channel
from gateway.domain.records import Record
from gateway.live.encoding import Block, Encoding
from gateway.live.subscription import TopicSubscription
from gateway.live.viewer import Viewer

__all__ = ["BLOCK_BYTES", "Selection"]

BLOCK_BYTES = 256 * 1024  # one block, or one sample if that is larger


class Selection:
    """Takes samples in as they come, and gives blocks out, once a tick."""

    __slots__ = ("_due_s", "_interval_s", "_last_stamp_ns", "_waiting", "channel", "groups", "latest", "rate_hz")

    def __init__(self, channel: Channel, *, latest: bool, rate_hz: float) -> None:
        self.channel = channel
        self.latest = latest
        self.rate_hz = rate_hz
        self.groups: dict[Encoding, dict[tuple[Viewer, TopicSubscription], None]] = {}  # who gets the same bytes
        self._interval_s = 1.0 / rate_hz if rate_hz > 0 else 0.0
        self._waiting: list[Record] = []
        self._due_s = 0.0
        self._last_stamp_ns: int | None = None

    def add(self, viewer: Viewer, subscription: TopicSubscription, encoding: Encoding) -> None:
        """A subscription is of this kind."""
        self.groups.setdefault(encoding, {})[viewer, subscription] = None

    def discard(self, viewer: Viewer, subscription: TopicSubscription) -> None:
        """A subscription is over."""
        for encoding, members in list(self.groups.items()):
            members.pop((viewer, subscription), None)
            if not members:
                del self.groups[encoding]

    def offer(self, records: list[Record]) -> bool:
        """Take samples in; whether something began to wait."""
        idle = not self._waiting
        if self.latest:
            self._waiting = records[-1:]
        elif self._interval_s:
            self._waiting += [record for record in records if self._passes(record.stamp_ns)]
        else:
            self._waiting += records
        return idle and bool(self._waiting)

    def due_s(self, now_s: float) -> float:
        """When what waits may go; not later than now: at once."""
        return self._due_s if self.latest and self._interval_s else now_s

    def take(self, now_s: float) -> list[Block]:
        """What goes out now, in blocks."""
        records, self._waiting = self._waiting, []
        if self._interval_s and self.latest:
            due_s = self._due_s + self._interval_s
            self._due_s = due_s if due_s > now_s else now_s + self._interval_s
        if not records:
            return []
        whole = Block(self.channel, records)
        if whole.size_bytes <= BLOCK_BYTES or len(records) == 1:
            return [whole]
        return [Block(self.channel, piece) for piece in _pieces(records)]

    def _passes(self, stamp_ns: int) -> bool:
        """Thin a queue by the samples' own stamps, so that a burst of a steady topic stays steady."""
        last_ns = self._last_stamp_ns
        if last_ns is not None and last_ns <= stamp_ns < last_ns + self._interval_s * 0.999e9:
            return False
        self._last_stamp_ns = stamp_ns
        return True


def _pieces(records: list[Record]) -> Iterator[list[Record]]:
    start = size_bytes = 0
    for index, record in enumerate(records):
        if size_bytes and size_bytes + record.size_bytes > BLOCK_BYTES:
            yield records[start:index]
            start, size_bytes = index, 0
        size_bytes += record.size_bytes
    yield records[start:]
