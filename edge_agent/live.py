"""The live class's queue: samples that a viewer wants now; bounded in bytes, and the oldest yields."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from edge_agent.channels import Channel
from metaros.limits import LIMITS

__all__ = ["LiveQueue", "LiveSample"]

OVERHEAD_BYTES = 128  # what one waiting sample costs beside its bytes


class LiveSample(NamedTuple):
    """One sample that a viewer wants."""

    seq: int
    stamp_ns: int
    data: bytes


class LiveQueue:
    """First in, first out over all channels; what is dropped is counted on its channel. The event loop owns it."""

    def __init__(self, *, max_bytes: int = LIMITS.live_bytes) -> None:
        self.max_bytes = max_bytes
        self.seal: Callable[[Channel, int, bytes], bytes] | None = None  # what waits of a payload and its number
        self.dropped = 0
        self._queue: deque[tuple[Channel, LiveSample, int]] = deque()
        self.size_bytes = 0

    def __len__(self) -> int:
        return len(self._queue)

    def append(self, channel: Channel, stamp_ns: int, payload: bytes) -> None:
        """Queue a sample under its channel's next number; the oldest make room."""
        channel.live_seq += 1
        if self.seal is not None:
            payload = self.seal(channel, channel.live_seq, payload)
        size = len(payload) + OVERHEAD_BYTES
        self._queue.append((channel, LiveSample(channel.live_seq, stamp_ns, payload), size))
        self.size_bytes += size
        while self.size_bytes > self.max_bytes:
            dropped, _, size = self._queue.popleft()
            dropped.dropped += 1
            self.dropped += 1
            self.size_bytes -= size

    def take(self, max_bytes: int) -> dict[int, list[LiveSample]]:
        """At least one sample, and then what fits, by channel."""
        runs: dict[int, list[LiveSample]] = {}
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
        self.dropped += len(self._queue)
        self._queue.clear()
        self.size_bytes = 0
