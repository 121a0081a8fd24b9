"""Server-sent events: how one is written, and a stream of them that says it lives while nothing happens."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from contextlib import aclosing
from typing import Any, TypeVar

import orjson

from gateway.api.problem import error_code
from metaros.errors import MetarosError

__all__ = ["EVENT_STREAM", "HEADERS", "EventPieces", "server_event"]

EVENT_STREAM = "text/event-stream"
HEADERS = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}  # no proxy may hold events back
BEAT_S = 10.0  # proxies, and browsers that slept, find out so that the other end has gone
RETRY_MS = 2000

Item = TypeVar("Item")


def server_event(data: Any, *, name: str = "", cursor: str = "") -> bytes:
    """One event; without a name a browser's `onmessage` gets it, its `cursor` comes back as Last-Event-ID."""
    head = (f"event: {name}\n" if name else "") + (f"id: {cursor}\n" if cursor else "")
    return head.encode() + b"data: " + orjson.dumps(data) + b"\n\n"


class EventPieces:
    """Items of a generator as server-sent events, for DownloadResponse; a comment every BEAT_S where none came."""

    def __init__(
        self,
        items: AsyncGenerator[Item, None],
        written: Callable[[Item], bytes],
        *,
        cursor: str = "",
        closed: Callable[[], None] | None = None,
        beat_s: float = BEAT_S,
    ) -> None:
        """`written` makes events of an item; `cursor` is where the stream begins, so that a client that loses it
        before the first event goes on from there; `closed` is called once, however it ends.
        """
        self._items = items
        self._written = written
        self._cursor = cursor
        self._closed = closed
        self._beat_s = beat_s

    async def pieces(self) -> AsyncIterator[bytes]:
        """Until the items end or fail; then an event `end` says why."""
        end = {"code": "stream_over", "message": "ask again with the last id"}
        start = f"id: {self._cursor}\n" if self._cursor else ""
        yield f"retry: {RETRY_MS}\n{start}\n".encode()
        try:
            async with aclosing(self._items) as items:
                async for piece in _beating(items, self._written, beat_s=self._beat_s):
                    yield piece
        except MetarosError as error:
            end = {"code": error_code(error), "message": str(error)}
        yield server_event(end, name="end")

    def close(self) -> None:
        """Give its place to another."""
        closed, self._closed = self._closed, None
        if closed is not None:
            closed()


async def _beating(
    items: AsyncGenerator[Item, None], written: Callable[[Item], bytes], *, beat_s: float
) -> AsyncIterator[bytes]:
    coming: asyncio.Task[Item] | None = None
    try:
        while True:
            coming = coming or asyncio.ensure_future(anext(items))
            done, _ = await asyncio.wait({coming}, timeout=beat_s)
            if not done:
                yield b":\n\n"
                continue
            try:
                item = coming.result()
            except StopAsyncIteration:
                return
            coming = None
            yield written(item)
    finally:
        if coming is not None:
            coming.cancel()
            await asyncio.gather(coming, return_exceptions=True)
