"""One subscription of one viewer to topics, and what waits for it while its connection takes nothing. Pure.

Mode "latest": of each channel only the newest sample waits; one that is replaced was not lost. Mode "queue": samples
wait in order, up to `queue_bytes`; then the oldest are dropped, one by one, and counted.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from gateway.domain.channel import Channel
from gateway.live.encoding import Block, Encoding

__all__ = ["TopicSubscription"]

Identity = tuple[str, str, str, str, str, bytes]


class TopicSubscription:
    """What is wanted, and in which form; `number` is its name on the connection."""

    def __init__(
        self,
        number: int,
        wants: Callable[[Channel], bool],
        encoding: Callable[[Channel], Encoding],
        *,
        max_rate_hz: float = 0.0,
        latest: bool = False,
        queue_bytes: int = 1024 * 1024,
    ) -> None:
        """`wants` and `encoding` are asked once per channel; a rate of 0 is every sample."""
        self.number = number
        self.wants = wants
        self.encoding = encoding
        self.max_rate_hz = max_rate_hz
        self.latest = latest
        self.size_bytes = 0
        self.dropped = 0
        self.reported = 0
        self.queue_bytes = queue_bytes
        self._waiting: deque[tuple[Block, Encoding]] = deque()
        self._start = 0  # samples of the oldest block that were dropped
        self._newest: dict[Identity, tuple[Block, Encoding]] = {}

    def hold(self, block: Block, encoding: Encoding) -> int:
        """Let a block wait; returns by how many bytes the waiting data grew (or shrank)."""
        before = self.size_bytes
        self.size_bytes += block.size_bytes
        if self.latest:
            replaced = self._newest.pop(block.channel.identity, None)
            if replaced is not None:
                self.size_bytes -= replaced[0].size_bytes
            self._newest[block.channel.identity] = block, encoding
        else:
            self._waiting.append((block, encoding))
            while self.size_bytes > self.queue_bytes and not self._is_last():
                self.drop_oldest()
        return self.size_bytes - before

    def take(self) -> tuple[Block, Encoding] | None:
        """What has waited longest."""
        if self._newest:
            oldest = self._newest.pop(next(iter(self._newest)))
        elif self._waiting:
            block, encoding = self._waiting.popleft()
            oldest = block.rest(self._start), encoding
            self._start = 0
        else:
            return None
        self.size_bytes -= oldest[0].size_bytes
        return oldest

    def drop_oldest(self) -> int:
        """Give the oldest waiting sample up; returns its bytes."""
        if self._waiting:
            records = self._waiting[0][0].records
            size_bytes = records[self._start].size_bytes
            self._start += 1
            if self._start == len(records):
                self._waiting.popleft()
                self._start = 0
        elif self._newest:
            size_bytes = self._newest.pop(next(iter(self._newest)))[0].size_bytes
        else:
            return 0
        self.size_bytes -= size_bytes
        self.dropped += 1
        return size_bytes

    def _is_last(self) -> bool:
        """Whether only one sample waits: it stays, however large it is."""
        return len(self._waiting) == 1 and self._start == len(self._waiting[0][0].records) - 1
