"""What of a video channel's frames goes on: the whole stream, or its key frames only, never a frame without the one
that it builds on. Pure.
"""

from __future__ import annotations

from typing import SupportsBytes

from edge_agent.config.topic_table import Delivery, TopicRule
from edge_agent.forwarding.filters import Selector
from edge_agent.forwarding.video_queue import VideoQueue
from metaros.link.video_frames import KEYS_ONLY_HZ, Frame, GroupGate, frame_of

__all__ = ["VideoSelector"]


class VideoSelector(Selector):
    """One video channel's decision, frame by frame; what a live viewer cannot decode asks for a key frame."""

    __slots__ = ("_gate", "_line", "_publisher", "_type_name")

    def __init__(
        self, type_name: str, line: VideoQueue, rule: TopicRule, delivery: Delivery, *, max_rate_hz: float
    ) -> None:
        super().__init__(rule, delivery, max_rate_hz=max_rate_hz)
        self._type_name = type_name
        self._line = line
        self._gate = GroupGate()
        self._publisher = b""

    def demand(self, rate_hz: float | None) -> None:
        """See Selector; who begins to watch begins at a key frame."""
        super().demand(rate_hz)
        if rate_hz is None:
            self._gate.lost()

    def takes(self, payload: SupportsBytes, publisher: bytes, number: int, now_s: float) -> bool:
        """Whether a frame, its publisher's so-and-so-manieth, leaves the robot."""
        rate_hz = self._rate_hz()
        if rate_hz is None:
            self._gate.lost()  # what nobody takes is a hole
            return False
        frame = frame_of(self._type_name, bytes(payload))
        if 0 < rate_hz <= KEYS_ONLY_HZ:
            self._gate.lost()
            return frame is not Frame.DELTA and self.admit(now_s)
        if not self._live:
            return True  # it is kept as it was published, holes and all
        if publisher != self._publisher:
            self._publisher = publisher
            self._gate.lost()
        if self._gate.admit(frame, number):
            return True
        self._line.key_wanted = True
        return False

    def _rate_hz(self) -> float | None:
        """The limit that is in force, 0 none; None: nothing is to go."""
        if not self._forward:
            return None
        return self.demand_hz if self._live else self._max_rate_hz
