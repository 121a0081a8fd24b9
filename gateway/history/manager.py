"""Queries of stored messages for the API: bounded work on its own threads, answers ready to be sent.

Pages, instants and timelines share two threads and a bounded line in front of them. Each export has a thread at its
disposal while its reader takes a piece, and none in between; there are at most `LIMITS.exports`.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import orjson

from gateway.domain.channel import Channel
from gateway.domain.decoder import Decoder
from gateway.errors import StoreError, TooManyError
from gateway.history.export import Export, ExportRequest
from gateway.history.losses import Loss, loss_view, merged_losses
from gateway.history.pages import Page, PageRequest, message_facts, read_page
from gateway.history.snapshot import Snapshot, pack_snapshot, read_snapshot, snapshot_facts
from gateway.history.source import Source, StoreSource
from gateway.history.timeline import timeline_facts
from gateway.store import Store
from gateway.store.telemetry.history import StoredTopic, stored_channels, topic_names
from gateway.store.telemetry.timeline import read_density, series_count
from metaros.limits import LIMITS

__all__ = ["ExportStream", "HistoryManager"]

Result = TypeVar("Result")
THREADS = 2
WAITING = 64  # requests that are answered or wait for a thread


class HistoryManager:
    """Made and used in the event loop; `close` before the store closes."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._pages = ThreadPoolExecutor(THREADS, thread_name_prefix="gateway-history")
        self._exports = ThreadPoolExecutor(LIMITS.exports, thread_name_prefix="gateway-export")
        self._running: set[Export] = set()
        self._waiting = 0

    @property
    def exports(self) -> int:
        """How many run now."""
        return len(self._running)

    async def stored(self, robot_id: str) -> tuple[list[StoredTopic], int]:
        """What is stored of each topic of a robot, by name, and how many series it has."""
        return await self._store.stored_topics(robot_id), await self._store.read(
            lambda engine: series_count(engine, robot_id)
        )

    async def topic_names(self, robot_id: str) -> list[str]:
        """Every topic of a robot of which messages were ever stored."""
        return await self._store.read(lambda engine: topic_names(engine, robot_id))

    async def channels(self, robot_id: str, *, most: int) -> list[Channel]:
        """Of each topic of which messages are stored the channel with the newest of them, by topic."""
        return await self._store.read(lambda engine: stored_channels(engine, robot_id, most=most))

    async def timeline(self, robot_id: str, *, start_ns: int, end_ns: int, buckets: int) -> bytes:
        """The counts and losses of a range, as JSON."""
        density = await self._store.read(
            lambda engine: read_density(engine, robot_id, start_ns=start_ns, end_ns=end_ns, buckets=buckets)
        )

        def job(source: Source) -> bytes:
            losses = source.losses(robot_id, start_ns=start_ns, end_ns=end_ns)
            return _json(timeline_facts(density, losses, start_ns=start_ns, end_ns=end_ns))

        return await self._work(job)

    async def page(self, request: PageRequest, *, decoded: bool, show: Callable[[int], str]) -> bytes:
        """Messages and losses of a range, as JSON; `show` writes a stamp as a text."""

        def job(source: Source) -> bytes:
            page = read_page(source, request)
            decoder = Decoder() if decoded else None
            messages = [_shown(message_facts(message, decoder), show) for message in page.messages]
            losses = [*source.losses(request.robot_id, start_ns=request.start_ns, end_ns=request.end_ns), *page.losses]
            wanted = [loss for loss in losses if loss.topic is None or loss.topic in request.topics]
            return _json(
                {"messages": messages, "gaps": [loss_view(loss) for loss in merged_losses(wanted)], "next": page.next}
            )

        return await self._work(job)

    async def viewed(self, request: PageRequest, *, view: Callable[[Page, Sequence[Loss]], Result]) -> Result:
        """What `view` makes, on a thread, of a page and the losses of its topics."""

        def job(source: Source) -> Result:
            page = read_page(source, request)
            losses = [*source.losses(request.robot_id, start_ns=request.start_ns, end_ns=request.end_ns), *page.losses]
            return view(page, [loss for loss in losses if loss.topic is None or loss.topic in request.topics])

        return await self._work(job)

    async def snapshot(
        self, robot_id: str, topics: Sequence[str], *, t_ns: int, max_age_ns: int, show: Callable[[int], str] | None
    ) -> bytes:
        """The newest message of each topic at a time: as records, or with `show` as JSON."""

        def job(source: Source) -> bytes:
            snapshot = read_snapshot(source, robot_id, topics, t_ns=t_ns, max_age_ns=max_age_ns)
            if show is None:
                return pack_snapshot(snapshot)
            decoder = Decoder()
            messages = [_shown(message_facts(message, decoder), show) for message in snapshot.messages]
            return _json({**snapshot_facts(snapshot), "messages": messages})

        return await self._work(job)

    async def read(self, request: PageRequest) -> Page:
        """Messages of a range as they are stored."""
        return await self._work(lambda source: read_page(source, request))

    async def at(self, robot_id: str, topics: Sequence[str], *, t_ns: int, max_age_ns: int) -> Snapshot:
        """The newest message of each topic at a time, as it is stored."""
        return await self._work(
            lambda source: read_snapshot(source, robot_id, topics, t_ns=t_ns, max_age_ns=max_age_ns)
        )

    def export(self, request: ExportRequest) -> ExportStream:
        """An MCAP file, to be taken piece by piece; TooManyError when as many are made as there may be."""
        if len(self._running) >= LIMITS.exports:
            raise TooManyError(f"{LIMITS.exports} exports are being made; try again when one is done")
        export = Export(StoreSource(self._store, asyncio.get_running_loop()), request)
        self._running.add(export)
        return ExportStream(export, self._exports, self._running.discard)

    def close(self) -> None:
        """Give up what runs."""
        for export in self._running:
            export.stop()
        self._pages.shutdown(wait=False, cancel_futures=True)
        self._exports.shutdown(wait=False, cancel_futures=True)

    async def _work(self, job: Callable[[Source], Result]) -> Result:
        """Do it on one of the threads."""
        if self._waiting >= WAITING:
            raise TooManyError(f"{WAITING} questions about history are waiting already")
        loop = asyncio.get_running_loop()
        source = StoreSource(self._store, loop)
        self._waiting += 1
        try:
            return await loop.run_in_executor(self._pages, job, source)
        finally:
            self._waiting -= 1


class ExportStream:
    """A file in the making; it counts as one until `close`, which every taker calls."""

    def __init__(self, export: Export, threads: ThreadPoolExecutor, closed: Callable[[Export], None]) -> None:
        self._export = export
        self._threads = threads
        self._closed = closed

    async def pieces(self) -> AsyncIterator[bytes]:
        """The file's bytes; it is whole when this ends by itself. StoreError when the store fails."""
        loop = asyncio.get_running_loop()
        pieces = self._export.pieces()
        while (piece := await loop.run_in_executor(self._threads, next, pieces, None)) is not None:
            yield piece
        if self._export.stopped:
            raise StoreError("the gateway is going down")

    def close(self) -> None:
        """Done, or given up."""
        self._export.stop()
        self._closed(self._export)


def _shown(facts: dict[str, Any], show: Callable[[int], str]) -> dict[str, Any]:
    stamp_ns = facts.pop("stamp_ns")
    return {"stamp": show(stamp_ns), **facts}


def _json(answer: dict[str, Any]) -> bytes:
    return orjson.dumps(answer, option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS)
