"""Topics of which only the newest sample is worth keeping: while the outbox is behind it waits here, and is replaced.

What waits here is not accepted yet: it is gone when the agent ends, and no gap is declared for what it replaced.
Of video only key frames wait, and what followed one that was replaced is left out with it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from edge_agent.forwarding.channels import Channel
from edge_agent.outbox import CLASSES, Outbox
from metaros.link.video_frames import Frame, frame_of

__all__ = ["LatestOnly"]

_LOOK_S = 0.1


class LatestOnly:
    """The newest sample of each such channel; on the event loop."""

    def __init__(self, outbox: Outbox, wake_writer: Callable[[], None]) -> None:
        self._outbox = outbox
        self._wake_writer = wake_writer
        self._held: dict[int, tuple[Channel, int, bytes]] = {}
        self._broken: set[int] = set()  # video channels that miss frames, up to their next key frame
        self._looking = False

    def __len__(self) -> int:
        return len(self._held)

    def put(self, channel: Channel, stamp_ns: int, payload: bytes) -> None:
        """Take a sample over: into the outbox, or in place of the one that waits."""
        if channel.video is not None and not self._decodable(channel, payload):
            channel.thinned += 1
            return
        if channel.channel_id in self._held:
            channel.thinned += 1
        self._held[channel.channel_id] = (channel, stamp_ns, payload)
        self._release()

    def _release(self) -> None:
        """Hand on what waits, as far as the outbox is not behind; look again soon where it is."""
        for number, (channel, stamp_ns, payload) in list(self._held.items()):
            if not self._behind(channel.delivery):
                self._outbox.append(number, channel.delivery, stamp_ns, payload)
                del self._held[number]
        if self._held and not self._looking:
            self._looking = True
            asyncio.get_running_loop().call_later(_LOOK_S, self._look)

    def _decodable(self, channel: Channel, payload: bytes) -> bool:
        """Whether a frame may follow what was taken over of its channel before."""
        number = channel.channel_id
        if frame_of(channel.type_name, payload) is not Frame.DELTA:
            self._broken.discard(number)
        elif number in self._held or self._behind(channel.delivery):
            self._broken.add(number)
        return number not in self._broken

    def _behind(self, delivery: str) -> bool:
        """Whether a sample of this class would wait: the link is down, or more than a batch is before it."""
        log = self._outbox.logs[delivery]
        return not self._outbox.online or log.waiting_bytes > CLASSES[delivery].sync_bytes

    def _look(self) -> None:
        self._looking = False
        self._release()
        self._wake_writer()
