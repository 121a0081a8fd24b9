"""The live class's queue: samples that a viewer wants now; bounded in bytes, and the oldest yields."""

from __future__ import annotations

from collections import deque

from edge_agent.channels import Channel
from edge_agent.outbox import OVERHEAD_BYTES, Sample
from metaros.limits import LIMITS

__all__ = ["LIVE_BYTES", "LiveQueue"]

LIVE_BYTES = LIMITS.outbox_bytes // 8


class LiveQueue:
    """First in, first out over all channels; what is dropped is counted on its channel. The event loop owns it."""

    def __init__(self, *, max_bytes: int = LIVE_BYTES) -> None:
        self._max_bytes = max_bytes
        self._queue: deque[tuple[Channel, Sample, int]] = deque()
        self.size_bytes = 0

    def __len__(self) -> int:
        return len(self._queue)

    def append(self, channel: Channel, stamp_ns: int, payload: bytes) -> None:
        """Queue a sample under its channel's next number; the oldest make room."""
        channel.live_seq += 1
        size = len(payload) + OVERHEAD_BYTES
        self._queue.append((channel, Sample(channel.live_seq, stamp_ns, payload), size))
        self.size_bytes += size
        while self.size_bytes > self._max_bytes:
            dropped, _, size = self._queue.popleft()
            dropped.dropped += 1
            self.size_bytes -= size

    def take(self, max_bytes: int) -> dict[int, list[Sample]]:
        """At least one sample, and then what fits, by channel."""
        runs: dict[int, list[Sample]] = {}
        taken = 0
        while self._queue and (taken == 0 or taken + self._queue[0][2] <= max_bytes):
            channel, sample, size = self._queue.popleft()
            runs.setdefault(channel.channel_id, []).append(sample)
            taken += size
        self.size_bytes -= taken
        return runs

    def clear(self) -> None:
        """Forget what nobody can see any more; it counts as dropped."""
        for channel, _, _ in self._queue:
            channel.dropped += 1
        self._queue.clear()
        self.size_bytes = 0
