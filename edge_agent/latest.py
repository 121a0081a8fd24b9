"""Topics of which only the newest sample is worth keeping: while the outbox is behind it waits here, and is replaced.

What waits here is not accepted yet: it is gone when the agent ends, and no gap is declared for what it replaced.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from edge_agent.channels import Channel
from edge_agent.outbox import CLASSES, Outbox

__all__ = ["LatestOnly"]

_LOOK_S = 0.1


class LatestOnly:
    """The newest sample of each such channel; on the event loop."""

    def __init__(self, outbox: Outbox, wake_writer: Callable[[], None]) -> None:
        self._outbox = outbox
        self._wake_writer = wake_writer
        self._held: dict[int, tuple[Channel, int, bytes]] = {}
        self._looking = False

    def __len__(self) -> int:
        return len(self._held)

    def put(self, channel: Channel, stamp_ns: int, payload: bytes) -> None:
        """Take a sample over: into the outbox, or in place of the one that waits."""
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

    def _behind(self, delivery: str) -> bool:
        """Whether a sample of this class would wait: the link is down, or more than a batch is before it."""
        log = self._outbox.logs[delivery]
        return not self._outbox.online or log.waiting_bytes > CLASSES[delivery].sync_bytes

    def _look(self) -> None:
        self._looking = False
        self._release()
        self._wake_writer()
