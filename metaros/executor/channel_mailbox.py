"""A mailbox that is filled from channels as its items are handled: who writes to them waits for the executor."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from typing import Any, ClassVar, Final

from metaros.executor.mailbox import Mailbox

__all__ = ["CHANNEL", "ChannelMailbox"]

CHANNEL: Final = 1024  # items that a channel is to hold
_AHEAD: Final = 512  # items that are taken out of channels before the executor has handled them
_PATIENCE_S: Final = 0.1  # a callback may block for so long before its channels are emptied for it


class ChannelMailbox(Mailbox):
    """Keep-all: the backlog is in channels of `CHANNEL` items outside Python, and up to `_AHEAD` of it here.

    The ingress calls everything here with its lock held. A channel is a function that returns its oldest item, or None
    where it has none. The mailbox's sink, `Ingress.put_to`, is a bell, to be rung after an item is in the channel.

    While a callback blocks for longer than `_PATIENCE_S`, what arrives is moved here, bounded in bytes: a full channel
    would stall everything else on the link, and end it in seconds.
    """

    channelled: ClassVar[bool] = True

    __slots__ = ("_ahead", "_head", "_head_s", "channels")

    def __init__(self, handle: Callable[[Any], Any], **bounds: Any) -> None:
        super().__init__(handle, **bounds)
        self.channels: tuple[Callable[[], Any], ...] = ()
        self._ahead = _AHEAD
        self._head = 0  # which item was the oldest when somebody looked
        self._head_s = 0.0  # since when

    def refill(self) -> None:
        """Take out of the channels what the executor may have before it: so many items, and no more bytes than fit."""
        pending = self.pending
        for receive in self.channels:
            if len(pending) >= self._ahead or (item := receive()) is None:
                continue
            pending.append(item)
            self._ahead = max(1, min(_AHEAD, self.limit_bytes // self.size_of(item)))
            pending.extend(islice(iter(receive, None), max(0, self._ahead - len(pending))))

    def relieve(self, now_s: float) -> bool:
        """Empty the channels where no item was handled for so long; whether there was anything in them."""
        try:
            head = id(self.pending[0])
        except IndexError:
            head = 0
        if not head or head != self._head:
            self._head, self._head_s = head, now_s
        if not head or now_s - self._head_s < _PATIENCE_S:
            return False
        before = len(self.pending)
        for receive in self.channels:
            self.pending.extend(islice(iter(receive, None), CHANNEL))
        moved = len(self.pending) > before
        if moved:
            self.trim()
        return moved
