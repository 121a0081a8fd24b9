"""What waits to be written to one lane: frames in order, bounded in bytes, with one place for the newest teleop.

Speech keeps its order, and what does not go at once is dropped: late speech is worth nothing, and no reason to hang up.
"""

from __future__ import annotations

import asyncio
from collections import deque

from metaros._proto import link_pb2

__all__ = ["LaneOutbox"]

TALK_WAITING = 25  # half a second of speech


class LaneOutbox:
    """Filled and emptied on the event loop. When it is full the lane is too slow to live: `put` answers False."""

    def __init__(self, *, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._bytes = 0
        self._frames: deque[link_pb2.GatewayFrame] = deque()
        self._teleop: link_pb2.GatewayFrame | None = None
        self._talk_waiting = 0
        self._closed = asyncio.Event()
        self._wake = asyncio.Event()

    def put(self, frame: link_pb2.GatewayFrame) -> bool:
        """Queue a frame; a newer teleop replaces a waiting one. False when the bound would be passed."""
        size_bytes = frame.ByteSize()
        speech = frame.WhichOneof("frame") == "talk"
        if speech and (self._talk_waiting >= TALK_WAITING or self._bytes + size_bytes > self._max_bytes):
            return True
        if frame.WhichOneof("frame") == "teleop":
            self._teleop = frame
        elif self._bytes + size_bytes > self._max_bytes or self._closed.is_set():
            return False
        else:
            self._talk_waiting += speech
            self._frames.append(frame)
            self._bytes += size_bytes
        self._wake.set()
        return True

    def close(self) -> None:
        """Nothing more comes; what is queued is still written."""
        self._closed.set()
        self._wake.set()

    async def closed(self) -> None:
        """Wait until nothing more comes."""
        await self._closed.wait()

    async def next(self) -> link_pb2.GatewayFrame | None:
        """The next frame, teleop first; None when the outbox is closed and empty."""
        while True:
            if self._teleop is not None and not self._closed.is_set():
                frame, self._teleop = self._teleop, None
                return frame
            if self._frames:
                frame = self._frames.popleft()
                self._bytes -= frame.ByteSize()
                self._talk_waiting -= frame.WhichOneof("frame") == "talk"
                return frame
            if self._closed.is_set():
                return None
            self._wake.clear()
            await self._wake.wait()
