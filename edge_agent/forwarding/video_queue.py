"""The frames of one live video channel that wait for the link, and whether the next can be decoded after them. Pure."""

from __future__ import annotations

from collections import deque

from metaros.limits import LIMITS
from metaros.link.video_frames import Frame

__all__ = ["VideoQueue"]

BEHIND_S = 0.4  # of video that waits: the link carries less than comes


class VideoQueue:
    """One channel's share of the live queue; the event loop owns it. Time is that of the samples' own stamps."""

    __slots__ = ("_cuts", "_stamps", "closed", "key_wanted", "sent_bytes")

    def __init__(self) -> None:
        self.closed = False  # frames were dropped after which nothing can be decoded before a key frame
        self.key_wanted = False  # somebody needs a key frame soon
        self.sent_bytes = 0  # taken for the link since the agent started
        self._cuts = 0
        self._stamps: deque[int] = deque()

    @property
    def waiting_s(self) -> float:
        """How much video waits."""
        return (self._stamps[-1] - self._stamps[0]) / 1e9 if self._stamps else 0.0

    @property
    def too_long(self) -> bool:
        """Whether so much waits that viewers are better off with the newest."""
        return self.waiting_s > LIMITS.video_wait_s

    def admit(self, frame: Frame) -> bool:
        """Whether a frame may wait: after a cut only from a key frame on."""
        if self.closed and frame is Frame.DELTA:
            self.key_wanted = True
            return False
        self.closed = False
        return True

    def pushed(self, stamp_ns: int) -> None:
        """A frame waits."""
        self._stamps.append(stamp_ns)

    def popped(self, size_bytes: int) -> None:
        """The oldest was taken for the link."""
        self._stamps.popleft()
        self.sent_bytes += size_bytes

    def dropped(self, count: int) -> None:
        """So many of the oldest were dropped."""
        self._cuts += 1
        for _ in range(count):
            self._stamps.popleft()
        if not self._stamps:
            self.closed = self.key_wanted = True

    def is_behind(self) -> bool:
        """Whether the link did not keep up since this was asked last."""
        cuts, self._cuts = self._cuts, 0
        return cuts > 0 or self.waiting_s > BEHIND_S
