"""The frames of one video channel that all subscriptions with the same limit get, cut into groups. Pure.

What a limit of `KEYS_ONLY_HZ` or less leaves is key frames only; any other limit leaves the whole stream.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from gateway.domain.records import Record
from gateway.live.encoding import Block
from gateway.live.selection import BLOCK_BYTES, Selection
from gateway.live.video import VideoBlock, video_frame
from metaros.link.video_frames import KEYS_ONLY_HZ, Frame

__all__ = ["VideoSelection"]


class VideoSelection(Selection):
    """The frames that all subscriptions with the same limit get; mode "latest" leaves none out here."""

    __slots__ = ()

    def offer(self, records: list[Record]) -> bool:
        """See Selection."""
        idle = not self._waiting
        if 0 < self.rate_hz <= KEYS_ONLY_HZ:
            keys = [record for record in records if video_frame(self.channel, record) is not Frame.DELTA]
            self._waiting += [record for record in keys if self._passes(record.stamp_ns)]
        else:
            self._waiting += records
        return idle and bool(self._waiting)

    def due_s(self, now_s: float) -> float:
        """See Selection."""
        return now_s

    def take(self, now_s: float) -> list[Block]:
        """See Selection."""
        records, self._waiting = self._waiting, []
        return [VideoBlock(self.channel, piece) for piece in self._pieces(records)]

    def _pieces(self, records: list[Record]) -> Iterator[list[Record]]:
        """Cut before each key frame, at each hole, and where a block is full."""
        start, size_bytes = 0, 0
        for end, (last, record) in enumerate(pairwise(records), 1):
            size_bytes += last.size_bytes
            full = size_bytes + record.size_bytes > BLOCK_BYTES
            if full or record.seq != last.seq + 1 or video_frame(self.channel, record) is Frame.KEY:
                yield records[start:end]
                start, size_bytes = end, 0
        if records:
            yield records[start:]
