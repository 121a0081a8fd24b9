"""One subscription of one viewer to topics, and what waits for it while its connection takes nothing. Pure.

Mode "latest": of each channel only the newest sample waits; one that is replaced was not lost. Mode "queue": samples
wait in order, up to `queue_bytes`; then the oldest are dropped, one by one, and counted. Video waits in groups of
frames: in mode "latest" the newest group replaces those before it; what is too much goes up to the next key frame.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from gateway.domain.channel import Channel
from gateway.live.encoding import Block, Encoding
from gateway.live.video import VideoBlock, VideoCursor
from metaros.limits import LIMITS

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
        self._turn = False  # it is that of what waits in order, beside newest samples
        self._newest: dict[Identity, tuple[Block, Encoding]] = {}
        self._video_cursors: dict[Identity, VideoCursor] = {}

    def video_cursor(self, channel: Channel) -> VideoCursor:
        """How far it is with a video channel."""
        video_cursor = self._video_cursors.get(channel.identity)
        if video_cursor is None:
            if len(self._video_cursors) >= LIMITS.channels_per_robot:
                del self._video_cursors[next(iter(self._video_cursors))]
            video_cursor = self._video_cursors[channel.identity] = VideoCursor()
        return video_cursor

    def hold(self, block: Block, encoding: Encoding) -> int:
        """Let a block wait; returns by how many bytes the waiting data grew (or shrank)."""
        before = self.size_bytes
        self.size_bytes += block.size_bytes
        if self.latest and not isinstance(block, VideoBlock):
            replaced = self._newest.pop(block.channel.identity, None)
            if replaced is not None:
                self.size_bytes -= replaced[0].size_bytes
            self._newest[block.channel.identity] = block, encoding
        else:
            if self.latest and isinstance(block, VideoBlock) and block.begins:
                self._remove(block.channel.identity)
            self._waiting.append((block, encoding))
            while self.size_bytes > self.queue_bytes and not self._is_last():
                self.drop_oldest()
        return self.size_bytes - before

    def take(self) -> tuple[Block, Encoding] | None:
        """What has waited longest."""
        if self._newest and not (self._waiting and self._turn):
            oldest = self._newest.pop(next(iter(self._newest)))
            self._turn = True
        elif self._waiting:
            self._turn = False
            block, encoding = self._waiting.popleft()
            oldest = block.rest(self._start), encoding
            self._start = 0
        else:
            return None
        self.size_bytes -= oldest[0].size_bytes
        return oldest

    def drop_oldest(self) -> int:
        """Give the oldest waiting sample up, of video all up to the next key frame; returns the bytes."""
        if self._waiting and isinstance(self._waiting[0][0], VideoBlock):
            return self._drop_group(self._waiting[0][0].channel.identity)
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

    def _drop_group(self, identity: Identity) -> int:
        """Give the oldest block of a video channel up, and what builds on it."""
        before = self.size_bytes
        self.dropped += self._remove(identity, only_group=True)
        return before - self.size_bytes

    def _remove(self, identity: Identity, *, only_group: bool = False) -> int:
        """Forget what waits of a video channel, or its oldest group only; how many samples that was."""
        kept = deque[tuple[Block, Encoding]]()
        removed, going = 0, True
        for block, encoding in self._waiting:
            if block.channel.identity != identity:
                kept.append((block, encoding))
                continue
            going = going and not (only_group and removed and isinstance(block, VideoBlock) and block.begins)
            if going:
                removed += len(block.records)
                self.size_bytes -= block.size_bytes
            else:
                kept.append((block, encoding))
        self._waiting = kept
        return removed

    def _is_last(self) -> bool:
        """Whether only one sample waits: it stays, however large it is."""
        return len(self._waiting) == 1 and self._start == len(self._waiting[0][0].records) - 1
