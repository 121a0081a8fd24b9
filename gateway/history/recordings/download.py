"""Downloads of stored files: piece by piece, read on a thread, a bounded number at a time."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterator

from gateway.history.recordings.transfer import OnThread

__all__ = ["Download"]


class Download:
    """Take `pieces()` once, and `close()` it whatever happens."""

    def __init__(self, content: Iterator[bytes], *, on_thread: OnThread, closed: Callable[[], None]) -> None:
        self._content = content
        self._on_thread = on_thread
        self._closed: Callable[[], None] | None = closed

    async def pieces(self) -> AsyncIterator[bytes]:
        """The bytes; one piece is in memory at a time.

        Raises:
            ObjectStoreError, DamagedError: the rest cannot be read.
        """
        while piece := await self._on_thread(next, self._content, b""):
            yield piece

    def close(self) -> None:
        """Give its place to another."""
        closed, self._closed = self._closed, None
        if closed is not None:
            closed()
