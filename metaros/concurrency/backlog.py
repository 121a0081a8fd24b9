"""What waits for a bridge on one topic: bounded in messages and bytes, oldest dropped first and counted."""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

from metaros.limits import LIMITS

__all__ = ["Backlog"]

T = TypeVar("T")


class Backlog(Generic[T]):
    """A queue with one writing and one reading thread. `dropped` counts what newer items pushed out."""

    def __init__(
        self, *, depth: int = LIMITS.broker_queue_messages, limit_bytes: int = LIMITS.broker_queue_bytes
    ) -> None:
        self.dropped = 0
        self._depth = depth
        self._limit_bytes = limit_bytes
        self._items: deque[tuple[T, int]] = deque()
        self._added_bytes = 0  # each of the three is written by one thread only, or by the pop that got the item
        self._taken_bytes = 0
        self._pushed_bytes = 0

    def put(self, item: T, size_bytes: int) -> None:
        """Add an item. The newest is kept even where it alone is over the bound."""
        self._items.append((item, size_bytes))
        self._added_bytes += size_bytes
        while len(self._items) > 1 and (len(self._items) > self._depth or self.size_bytes > self._limit_bytes):
            try:
                _, pushed = self._items.popleft()
            except IndexError:  # the reader took it in this very moment
                return
            self._pushed_bytes += pushed
            self.dropped += 1

    def take(self) -> T | None:
        """The oldest item, or None."""
        try:
            item, size_bytes = self._items.popleft()
        except IndexError:
            return None
        self._taken_bytes += size_bytes
        return item

    @property
    def size_bytes(self) -> int:
        """What waits."""
        return self._added_bytes - self._taken_bytes - self._pushed_bytes

    def clear(self) -> None:
        """Forget what waits; it counts as neither taken nor dropped."""
        while self.take() is not None:
            pass

    def __len__(self) -> int:
        return len(self._items)
