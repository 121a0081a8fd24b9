"""A mailbox that is filled from channels as its items are handled: who writes to them waits for the executor."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from typing import Any, ClassVar, Final

from metaros.executor.mailbox import Mailbox

__all__ = ["CHANNEL", "POLL_S", "ChannelMailbox"]

CHANNEL: Final = 1024  # items that a channel is to hold
_AHEAD: Final = 512  # items that are taken out of channels before the executor has handled them
POLL_S: Final = 0.0003  # lets a batch gather: switching threads for every item would cost more
_FLOOD: Final = 100  # times that the bell was rung between two looks, 10 ms apart
_QUIET: Final = 100
_PATIENCE_S: Final = 0.1  # a callback may block for so long before its channels are emptied for it


class ChannelMailbox(Mailbox):
    """Keep-all: the backlog is in channels of `CHANNEL` items outside Python, and up to `_AHEAD` of it here.

    The ingress calls everything here with its lock held. A channel is a function that returns its oldest item, or None
    where it has none. The mailbox's sink, `Ingress.put_to`, is a bell, to be rung after an item is in the channel.

    While a callback blocks for longer than `_PATIENCE_S`, what arrives is moved here, bounded in bytes: a full channel
    would stall everything else on the link, and end it in seconds.

    A bell costs each item a call into Python on its writer's thread. So it is silenced in a flood, and the relief
    thread looks into the channels every `POLL_S` instead, until they were empty `_QUIET` times.
    """

    channelled: ClassVar[bool] = True

    __slots__ = ("_ahead", "_head", "_head_s", "_quiet", "bells", "channels", "polled", "rung")

    def __init__(self, handle: Callable[[Any], Any], **bounds: Any) -> None:
        super().__init__(handle, **bounds)
        self.channels: tuple[Callable[[], Any], ...] = ()
        self.bells: tuple[Callable[[bool], None], ...] = ()  # each turns one on or off
        self.rung = 0  # times since somebody looked
        self.polled = False  # whether the bells are silent, and the relief thread looks into the channels
        self._quiet = 0
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

    def change(self) -> bool:
        """Whether the bells are to be silenced, or to be rung again; asked at every look of the relief thread."""
        rung, self.rung = self.rung, 0
        if not self.polled:
            self._quiet = 0
            return rung > _FLOOD and bool(self.bells)
        self._quiet = 0 if self.pending else self._quiet + 1
        return self._quiet > _QUIET

    def ring(self, on: bool) -> None:
        """Turn the bells on or off. Without the ingress's lock: what writes to the channels may be in a bell."""
        self.polled = not on
        for bell in self.bells:
            bell(on)
