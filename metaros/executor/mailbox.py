"""Mailboxes: what waits for one callback, bounded in count and bytes, oldest dropped first and counted."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, Final

__all__ = ["Mailbox"]

_FEW: Final = 64  # so few small items are not weighed: weighing costs more than it saves


class Mailbox:
    """The backlog of one subscription or service.

    `depth` is the history depth; None keeps all, up to `limit_bytes`. `handle(item)` is run by an executor, one item
    at a time; it returns a coroutine when the callback is an `async def`. `size_of(item)` weighs an item.
    `owner` is the node whose executor handles the items.
    """

    __slots__ = (
        "_size_of",
        "_weigh_at",
        "busy",
        "depth",
        "dropped",
        "handle",
        "limit_bytes",
        "owner",
        "pending",
        "queued",
    )

    def __init__(
        self,
        handle: Callable[[Any], Any],
        *,
        owner: object,
        depth: int | None,
        limit_bytes: int,
        size_of: Callable[[Any], int],
    ) -> None:
        self.handle = handle
        self.owner = owner
        self.depth = depth
        self.limit_bytes = limit_bytes
        self.pending: deque[Any] = deque()
        self.dropped = 0
        self.queued = False  # whether an executor knows that there is work
        self.busy = False  # whether a coroutine of this mailbox is running
        self._size_of = size_of
        self._weigh_at = _FEW

    def trim(self) -> None:
        """Drop the oldest items until the rest fits the bounds. Call after appending to `pending`."""
        pending = self.pending
        if self.depth is not None:
            excess = len(pending) - self.depth
            if excess > 0:
                self._drop(excess)
        if len(pending) > self._weigh_at or (pending and self._size_of(pending[-1]) > self.limit_bytes // _FEW):
            self._trim_bytes()
        elif len(pending) < _FEW:
            self._weigh_at = _FEW

    def _trim_bytes(self) -> None:
        """Keep the newest items that fit, the newest itself always; weigh again when a quarter more is waiting."""
        items = list(self.pending)
        kept = total = 0
        for item in reversed(items):
            total += self._size_of(item)
            if total > self.limit_bytes and kept:
                break
            kept += 1
        self._drop(len(items) - kept)
        self._weigh_at = kept + max(_FEW, kept // 4) if total < self.limit_bytes // 2 else kept + _FEW

    def _drop(self, count: int) -> None:
        for _ in range(count):
            try:
                self.pending.popleft()
            except IndexError:
                return
            self.dropped += 1

    def clear(self) -> None:
        """Forget what waits: its owner is closed."""
        self.pending.clear()
