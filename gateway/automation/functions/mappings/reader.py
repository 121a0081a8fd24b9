"""What follows a cursor in a stored stream, as events: read on the store's threads, decoded on one of its own."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol, TypeVar

from gateway.automation.functions.directory import MappingRow
from gateway.automation.functions.mappings.batch import Batch, Item, Matcher, wanted
from gateway.automation.sample_events import SampleReader
from gateway.domain.sample import Sample
from gateway.errors import DamagedError, PurgedError
from gateway.store.automation.mapping_cursors import Cursor, Stream, next_runs
from gateway.store.engine import StoreEngine
from gateway.store.telemetry.samples import StoredBatch, StoredRun
from metaros.limits import LIMITS, Limits

__all__ = ["Database", "MappingReader"]

Result = TypeVar("Result")
RUNS = 64  # that are looked up at a time


class Database(Protocol):
    """What is needed of the store."""

    @property
    def shared(self) -> bool:
        """Whether other gateways write to it."""

    @property
    def gateway_id(self) -> str:
        """Who reads here."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job in one write transaction."""

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job that reads, in a transaction of its own making."""

    async def load(self, run: StoredRun) -> StoredBatch:
        """A run's samples."""


class MappingReader:
    """Reads for all mappings."""

    def __init__(self, database: Database, *, limits: Limits = LIMITS) -> None:
        self._database = database
        self._limits = limits
        self._reader = SampleReader(limits=limits)
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="gateway-mappings")

    async def read(
        self, row: MappingRow, stream: Stream, cursor: Cursor, patterns: Sequence[Matcher], *, since_ns: int
    ) -> Batch:
        """The next batch, of messages that were stored since. Raises StoreError.

        What is stored no more, or damaged, is passed over: nobody will ever read it.
        """

        def find(engine: StoreEngine) -> Sequence[StoredRun]:
            with engine.transaction(write=False):
                return next_runs(engine, stream, after=cursor.seq, stored_ns=since_ns, limit=RUNS)

        items: list[Item] = []
        last, room = cursor.seq, self._limits.mapping_batch_bytes
        for run in await self._database.read(find):
            try:
                loaded = await self._database.load(run)
            except (PurgedError, DamagedError):
                last = max(last, run.last_seq)
                continue
            work = (row, stream, cursor, patterns, loaded, last, room, row.batch_size - len(items))
            found, last, room, full = await asyncio.get_running_loop().run_in_executor(
                self._thread, self._decoded, *work
            )
            items += found
            if full:
                return Batch(items, last, full=True)
        return Batch(items, last, full=False)

    def close(self) -> None:
        """Let the thread go."""
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _decoded(
        self,
        row: MappingRow,
        stream: Stream,
        cursor: Cursor,
        patterns: Sequence[Matcher],
        loaded: StoredBatch,
        last: int,
        room: int,
        count: int,
    ) -> tuple[list[Item], int, int, bool]:
        """Of a run what follows `last`: the items, how far it came, the bytes left, and whether the batch is full."""
        items: list[Item] = []
        for seq, stamp_ns, payload in loaded.samples():
            if seq <= last:
                continue
            over = items or room < self._limits.mapping_batch_bytes
            if len(items) == count or (cursor.most_seq and seq > cursor.most_seq) or (len(payload) > room and over):
                return items, last, room, True
            last = seq
            if row.start == "AT_TIMESTAMP" and stamp_ns < row.start_ns:
                continue
            self._reader.begin()
            sample = Sample(loaded.channel, seq, stamp_ns, loaded.receive_ns, payload)
            gateway_event = self._reader.read(stream.robot, stream.stream_id, stream.epoch, sample)
            item = Item(seq, loaded.receive_ns, gateway_event)
            if wanted(item, patterns, row.source_arn):
                items.append(item)
                room -= len(payload)
        return items, last, room, len(items) == count
