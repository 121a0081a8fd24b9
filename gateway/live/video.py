"""Video to viewers: whole groups of frames, so that nobody gets a frame without the one that it builds on. Pure.

A viewer gets nothing of a video channel before a key frame; where something was lost, be it in its own queue, on the
link or between gateways, nothing until the next one. Sealed frames, and those of formats that are not known here, pass
as they come.
"""

from __future__ import annotations

from collections.abc import Sequence

from gateway.domain.channel import Channel
from gateway.domain.records import Record
from gateway.live.encoding import Block
from metaros.link.video_frames import VIDEO_TYPES, Frame, GroupGate, frame_of

__all__ = ["ASK_AGAIN_S", "VideoBlock", "VideoCursor", "is_video", "video_frame"]

ASK_AGAIN_S = 2.0  # a viewer that falls behind again and again costs the others a key frame no more often


def is_video(channel: Channel) -> bool:
    """Whether a channel carries video."""
    return channel.schema_name in VIDEO_TYPES


def video_frame(channel: Channel, record: Record) -> Frame:
    """What a frame needs to be decoded; looked at once, for all viewers."""
    found = record.views.get(frame_of)
    if found is None:
        readable = channel.encoding == "cdr"
        found = record.views[frame_of] = frame_of(channel.schema_name, record.payload) if readable else Frame.ALONE
    frame: Frame = found
    return frame


class VideoBlock(Block):
    """Consecutive frames of which only the first may be a key frame: they go out together or not at all."""

    __slots__ = ("frame",)

    def __init__(self, channel: Channel, records: Sequence[Record]) -> None:
        super().__init__(channel, records)
        self.frame = video_frame(channel, records[0])

    @property
    def begins(self) -> bool:
        """Whether decoding can begin with it."""
        return self.frame is Frame.KEY

    def only(self, records: Sequence[Record]) -> Block:
        """See Block."""
        return VideoBlock(self.channel, records)


class VideoCursor:
    """How far one subscription is in one video channel."""

    __slots__ = ("_ask_s", "_gate", "began")

    def __init__(self) -> None:
        self._gate = GroupGate()
        self._ask_s = float("-inf")
        self.began = False  # something was sent

    def lacks(self, block: VideoBlock) -> bool:
        """Take note of the next block; whether it builds on what was not sent."""
        first = block.records[0].seq
        lacks = not block.begins and not self._gate.follows(first)
        self.began |= self._gate.admit(block.frame, first, count=block.records[-1].seq - first + 1)
        return lacks

    def may_ask(self, now_s: float) -> bool:
        """Whether it is time to ask for a key frame, which then counts as done."""
        if now_s < self._ask_s:
            return False
        self._ask_s = now_s + ASK_AGAIN_S
        return True
