"""Mailboxes: what waits for one callback, bounded in count and bytes, oldest dropped first and counted."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any, ClassVar, Final

from metaros.executor.groups import CallbackGroup

__all__ = ["Mailbox"]

_BURST_S: Final = 0.01  # for so long an executor that looks may have more than `depth` before it
_FEW: Final = 64  # so few small items are not weighed: weighing costs more than it saves


class Mailbox:
    """The backlog of one subscription or service.

    `depth` is the history depth; None keeps all, up to `limit_bytes`. `handle(item)` is run by an executor, one item
    at a time; it returns a coroutine when the callback is an `async def`. `size_of(item)` weighs an item.
    `owner` is the node whose executor handles the items, `group` says what its callbacks may overlap with.

    A link delivers in bursts: hundreds of small samples within a tenth of a millisecond, from one read of its socket.
    An executor that keeps up handles them in the next half millisecond, so `depth` counts only what it has not handled
    within `_BURST_S`: see `trim` and `drop_late`.
    """

    channelled: ClassVar[bool] = False  # whether it is filled from channels: see `ChannelMailbox`

    __slots__ = (
        "_weigh_at",
        "busy",
        "depth",
        "dropped",
        "group",
        "handle",
        "late_s",
        "limit_bytes",
        "owner",
        "pending",
        "queued",
        "running",
        "size_of",
    )

    def __init__(
        self,
        handle: Callable[[Any], Any],
        *,
        owner: object,
        depth: int | None,
        limit_bytes: int,
        size_of: Callable[[Any], int],
        group: CallbackGroup | None = None,
    ) -> None:
        self.handle = handle
        self.owner = owner
        self.depth = depth
        self.limit_bytes = limit_bytes
        self.pending: deque[Any] = deque()
        self.dropped = 0
        self.late_s = 0.0  # when what is beyond `depth` will be dropped, by the monotonic clock; 0.0 if nothing is
        self.queued = False  # whether an executor knows that there is work
        self.group = group
        self.running = 0  # coroutines of this mailbox that are not done
        self.busy = False  # whether no other may start meanwhile
        self.size_of = size_of
        self._weigh_at = _FEW

    def like(self) -> Mailbox:
        """An empty one with the same bounds and handler."""
        return Mailbox(
            self.handle,
            owner=self.owner,
            depth=self.depth,
            limit_bytes=self.limit_bytes,
            size_of=self.size_of,
            group=self.group,
        )

    def trim(self, looking_s: float | None = None) -> None:
        """Drop the oldest items until the rest fits the bounds. Call after appending to `pending`.

        An executor may take items out at the same time, on another thread. `looking_s` is the monotonic time where the
        mailbox's executor is looking at this moment: then what is beyond `depth` may wait for `_BURST_S`.
        """
        pending = self.pending
        if self.depth is not None:
            if len(pending) <= self.depth:
                self.late_s = 0.0
            elif looking_s is None or 0.0 < self.late_s < looking_s:
                self._keep_depth(self.depth)
            elif not self.late_s:
                self.late_s = looking_s + _BURST_S
        if len(pending) > self._weigh_at or self._newest_bytes() > self.limit_bytes // _FEW:
            self._trim_bytes()
        elif len(pending) < _FEW:
            self._weigh_at = _FEW

    def drop_late(self) -> None:
        """What waits beyond `depth` goes if its time is over. Call before taking an item while `late_s` is set."""
        depth = self.depth
        if depth is None or len(self.pending) <= depth:  # the executor has caught up
            self.late_s = 0.0
        elif time.monotonic() > self.late_s:
            self._keep_depth(depth)

    def _keep_depth(self, depth: int) -> None:
        self._drop(len(self.pending) - depth)
        self.late_s = 0.0

    def _newest_bytes(self) -> int:
        try:
            return self.size_of(self.pending[-1])
        except IndexError:
            return 0

    def _trim_bytes(self) -> None:
        """Where the bound is passed, keep the newest items that fill three quarters of it, so that it lasts a while."""
        items = list(self.pending)
        sizes = [self.size_of(item) for item in items]
        total = sum(sizes)
        if total > self.limit_bytes:
            count = 0
            while count < len(sizes) - 1 and total > self.limit_bytes * 3 // 4:
                total -= sizes[count]
                count += 1
            self._drop(count)
        left = len(self.pending)
        self._weigh_at = left + max(_FEW, left // 4)

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
