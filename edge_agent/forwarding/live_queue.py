"""The live class's queue: samples that a viewer wants now; bounded in bytes, and the oldest yields.

Of video whole groups of frames yield, so that what is sent can be decoded: the oldest, and with it all of its topic up
to the newest key frame. So does video that would come too late to be worth it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from edge_agent.forwarding.channels import Channel
from edge_agent.forwarding.video_queue import VideoQueue
from metaros.limits import LIMITS
from metaros.link.video_frames import Frame, frame_of

__all__ = ["LiveQueue", "LiveSample"]

OVERHEAD_BYTES = 128  # what one waiting sample costs beside its bytes


class LiveSample(NamedTuple):
    """One sample that a viewer wants."""

    seq: int
    stamp_ns: int
    data: bytes


class _Waiting(NamedTuple):
    channel: Channel
    sample: LiveSample
    size_bytes: int
    key: bool  # of video: decoding can begin here


class LiveQueue:
    """First in, first out over all channels; what is dropped is counted on its channel. The event loop owns it."""

    def __init__(self, *, max_bytes: int = LIMITS.live_bytes) -> None:
        self.max_bytes = max_bytes
        self.seal: Callable[[Channel, int, bytes], bytes] | None = None  # what waits of a payload and its number
        self.dropped = 0
        self._queue: deque[_Waiting] = deque()
        self.size_bytes = 0

    def __len__(self) -> int:
        return len(self._queue)

    def append(self, channel: Channel, stamp_ns: int, payload: bytes) -> None:
        """Queue a sample under its channel's next number; the oldest make room."""
        channel.live_seq += 1
        frame = None if channel.video is None else frame_of(channel.type_name, payload)  # before it is sealed
        if channel.video is not None and frame is not None and not channel.video.admit(frame):
            self._count_dropped(channel)
            return
        if self.seal is not None:
            payload = self.seal(channel, channel.live_seq, payload)
        size = len(payload) + OVERHEAD_BYTES
        key = frame is not None and frame is not Frame.DELTA
        self._queue.append(_Waiting(channel, LiveSample(channel.live_seq, stamp_ns, payload), size, key))
        self.size_bytes += size
        if channel.video is not None:
            channel.video.pushed(stamp_ns)
            if channel.video.too_long:
                self._drop_to_key_frame(channel, channel.video)
        while self.size_bytes > self.max_bytes:
            self._drop_oldest()

    def take(self, max_bytes: int) -> dict[int, list[LiveSample]]:
        """At least one sample, and then what fits, by channel."""
        runs: dict[int, list[LiveSample]] = {}
        taken = 0
        while self._queue and (taken == 0 or taken + self._queue[0].size_bytes <= max_bytes):
            channel, sample, size, _ = self._queue.popleft()
            runs.setdefault(channel.channel_id, []).append(sample)
            taken += size
            if channel.video is not None:
                channel.video.popped(size)
        self.size_bytes -= taken
        return runs

    def clear(self) -> None:
        """Forget what nobody can see any more; it counts as dropped."""
        while self._queue:
            waiting = self._queue.popleft()
            self._count_dropped(waiting.channel)
            if waiting.channel.video is not None:
                waiting.channel.video.popped(0)
        self.size_bytes = 0

    def _drop_oldest(self) -> None:
        channel = self._queue[0].channel
        if channel.video is not None:
            self._drop_to_key_frame(channel, channel.video)
            return
        self.size_bytes -= self._queue.popleft().size_bytes
        self._count_dropped(channel)

    def _drop_to_key_frame(self, channel: Channel, line: VideoQueue) -> None:
        """Drop a video channel's oldest frame and all up to its newest key frame after that; without one, all."""
        mine = [waiting for waiting in self._queue if waiting.channel is channel]
        keys = [position for position, waiting in enumerate(mine) if position and waiting.key]
        gone = mine[: keys[-1]] if keys else mine
        numbers = {waiting.sample.seq for waiting in gone}
        self._queue = deque(it for it in self._queue if it.channel is not channel or it.sample.seq not in numbers)
        for waiting in gone:
            self.size_bytes -= waiting.size_bytes
            self._count_dropped(channel)
        line.dropped(len(gone))

    def _count_dropped(self, channel: Channel) -> None:
        channel.dropped += 1
        self.dropped += 1
