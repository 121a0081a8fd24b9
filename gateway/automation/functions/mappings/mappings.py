"""Event source mappings: topics of robots read in batches, from where the mapping is in each stream on.

A mapping loses nothing that is stored: it remembers in the store how far each robot's stream was handled, and moves on
only when the function has taken a batch, or when that is given up and told. So messages of one robot and topic come in
order, and those that were under way when a gateway died come again. Of several gateways on one store one reads.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from gateway.automation.functions.directory import Directory, MappingRow
from gateway.automation.functions.mappings.batch import Batch, Matcher
from gateway.automation.functions.mappings.batch_run import BatchResult, BatchRun, BatchRunner
from gateway.automation.functions.mappings.reader import Database, MappingReader
from gateway.automation.functions.topic_arn import TopicArn, parse_topic_arn
from gateway.domain.automation.delivery import Put
from gateway.errors import StoreError
from gateway.store.automation.mapping_cursors import (
    Cursor,
    Stream,
    find_streams,
    forget_mapping,
    read_cursors,
    start_of,
)
from gateway.store.engine import StoreEngine
from gateway.store.fleet.updates import take_duty
from metaros.automation.rules.pattern import compile_pattern
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Mappings"]

log = logging.getLogger(__name__)

TICK_S = 0.25  # at most so late are batches whose window or wait is over
LOOK_S = 1.0  # at what other gateways stored
DUTY, DUTY_S, DUTY_EVERY_S = "mappings", 15.0, 5.0
LOOK_BACK_NS = 30 * 10**9  # gateways of one store may differ in their clocks, and commits take their time
BATCHES_EACH = 4  # of one mapping at a time, times its ParallelizationFactor


@dataclass(slots=True)
class _Shard:
    """One stream of one mapping."""

    cursor: Cursor
    ready_s: float | None = None  # since when there is something to read, monotonic
    news: int = 0  # how often more came
    due_s: float = 0.0  # not before
    ready_ns: int = 0  # when the oldest that waits came
    busy: bool = False


@dataclass(slots=True)
class _Source:
    """One mapping that is enabled."""

    row: MappingRow
    arn: TopicArn
    patterns: Sequence[Matcher]
    since_ns: int = 0
    shards: dict[Stream, _Shard] = field(default_factory=dict)
    busy: int = 0

    @property
    def most_busy(self) -> int:
        """How many batches may be under way."""
        return BATCHES_EACH * self.row.parallel


class Mappings:
    """Tell it of commits, and let `run` run. All methods on the event loop."""

    def __init__(
        self,
        database: Database,
        directory: Directory,
        batch_runner: BatchRunner,
        *,
        notify: Callable[[Sequence[Put]], None],
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._database = database
        self._directory = directory
        self._batch_runner = batch_runner
        self._notify = notify
        self._clock = clock
        self._limits = limits
        self._reader = MappingReader(database, limits=limits)
        self._sources: dict[str, _Source] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._news = asyncio.Event()
        self._changed = True
        self._on_duty = False
        self._duty_s = self._looked_s = self._looked_whole_s = -1e9
        directory.on_change(self._on_change)

    def on_committed(self, found: Iterable[tuple[Stream, str]]) -> None:
        """Streams of which more is stored, with their topics."""
        if not self._sources:
            return
        now_s, now_ns = self._clock.monotonic_s(), self._clock.wall_ns()
        for stream, topic in found:
            for source in self._sources.values():
                if source.arn.matches(stream.robot, topic):
                    self._wake(source, stream, now_s, now_ns)

    def iterator_age_s(self, function: str) -> float | None:
        """How long the oldest message has been waiting for a function; None where no mapping leads to it."""
        sources = [source for source in self._sources.values() if source.row.function == function]
        if not sources:
            return None
        shards = (shard for source in sources for shard in source.shards.values() if shard.ready_s is not None)
        return max(((self._clock.wall_ns() - shard.ready_ns) / 1e9 for shard in shards), default=0.0)

    def oldest_s(self) -> float:
        """How long the oldest message has been waiting for any function."""
        functions = {source.row.function for source in self._sources.values()}
        return max((self.iterator_age_s(function) or 0.0 for function in functions), default=0.0)

    async def run(self) -> None:
        """Until cancelled."""
        try:
            while True:
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(TICK_S):
                        await self._news.wait()
                self._news.clear()
                try:
                    await self.step()
                except StoreError as error:
                    log.debug("event source mappings wait for the store: %s", error)
        finally:
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)
            self._reader.close()

    async def step(self) -> None:
        """Begin every batch that is due. Raises StoreError."""
        if not await self._take_duty():
            return
        if self._changed:
            await self._learn()
        await self._look()
        now_s = self._clock.monotonic_s()
        for source in self._sources.values():
            for stream, shard in source.shards.items():
                if source.busy >= min(source.most_busy, self._limits.mapping_batches):
                    break
                if shard.ready_s is not None and not shard.busy and shard.due_s <= now_s:
                    self._begin(source, stream, shard)

    async def settle(self) -> None:
        """Return when no batch is under way."""
        while self._tasks:
            await asyncio.gather(*self._tasks)

    def _begin(self, source: _Source, stream: Stream, shard: _Shard) -> None:
        shard.busy = True
        source.busy += 1
        task = asyncio.create_task(self._turn(source, stream, shard))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _turn(self, source: _Source, stream: Stream, shard: _Shard) -> None:
        """Read a batch and hand it over, if it is time for it."""
        row, ready_s, news = source.row, shard.ready_s, shard.news
        try:
            batch = await self._reader.read(row, stream, shard.cursor, source.patterns, since_ns=source.since_ns)
            if self._is_early(row, batch, ready_s):
                shard.due_s = (ready_s or 0.0) + row.window_s
                return
            if batch.last_seq == shard.cursor.seq:
                if shard.news == news:  # nothing came meanwhile
                    shard.ready_s = None
                return
            done = await self._batch_runner.take(BatchRun(row=row, stream=stream, cursor=shard.cursor, batch=batch))
            self._after(source, shard, batch, done)
        except StoreError as error:
            log.debug("mapping %s waits for the store: %s", row.uuid, error)
            shard.due_s = self._clock.monotonic_s() + LOOK_S
        except Exception:  # whatever is wrong with one stream, the others go on
            log.exception("mapping %s failed at a stream of %s: a mistake of ours", row.uuid, stream.robot)
            shard.due_s = self._clock.monotonic_s() + DUTY_S
        finally:
            shard.busy = False
            source.busy -= 1
            self._news.set()

    def _after(self, source: _Source, shard: _Shard, batch: Batch, done: BatchResult) -> None:
        shard.cursor = done.cursor
        shard.ready_s = self._clock.monotonic_s()
        shard.due_s = shard.ready_s + done.wait_s
        if batch.items:
            shard.ready_ns = batch.items[-1].receive_ns if not done.wait_s else batch.items[0].receive_ns
            self._directory.note_mapping(source.row.uuid, done.result)
        if done.puts:
            self._notify(done.puts)

    def _is_early(self, row: MappingRow, batch: Batch, ready_s: float | None) -> bool:
        """Whether more is to be waited for."""
        if batch.full or not batch.items or not row.window_s or ready_s is None:
            return False
        return self._clock.monotonic_s() < ready_s + row.window_s

    def _wake(self, source: _Source, stream: Stream, now_s: float, now_ns: int) -> None:
        shard = source.shards.get(stream)
        if shard is None:
            if sum(len(item.shards) for item in self._sources.values()) >= self._limits.mapping_cursors:
                return  # it is found again when there is room: nothing of it is lost
            shard = source.shards[stream] = _Shard(Cursor(-1))
        shard.news += 1
        if shard.ready_s is None:
            shard.ready_s, shard.ready_ns = now_s, now_ns
        self._news.set()

    def _on_change(self, function: str) -> None:
        self._changed = True
        self._news.set()

    async def _take_duty(self) -> bool:
        if not self._database.shared:
            return True
        now_s = self._clock.monotonic_s()
        if now_s - self._duty_s >= DUTY_EVERY_S:
            holder, now_ns, for_ns = self._database.gateway_id, self._clock.wall_ns(), round(DUTY_S * 1e9)
            before, self._on_duty = self._on_duty, False
            mine = await self._database.run(
                lambda engine: take_duty(engine, DUTY, holder, now_ns=now_ns, for_ns=for_ns)
            )
            self._duty_s, self._on_duty = now_s, mine
            if mine and not before:
                self._sources.clear()
                self._changed = True
        return self._on_duty

    async def _learn(self) -> None:
        """Which mappings there are, how far they are, and of which streams there is something."""
        self._changed = False
        rows = {row.uuid: row for row in self._directory.mappings()}
        await self._database.run(lambda engine: forget_mapping(engine, rows))
        for uuid in [uuid for uuid, source in self._sources.items() if rows.get(uuid) != source.row]:
            del self._sources[uuid]
        for row in rows.values():
            if row.enabled and row.uuid not in self._sources:
                await self._open(row)

    async def _open(self, row: MappingRow) -> None:
        now_ns, now_s = self._clock.wall_ns(), self._clock.monotonic_s()
        source = _Source(row, parse_topic_arn(row.source_arn), [compile_pattern(item) for item in row.filters])

        def job(engine: StoreEngine) -> tuple[int, dict[Stream, Cursor]]:
            return start_of(engine, row.uuid, now_ns=now_ns), read_cursors(engine, row.uuid)

        source.since_ns, cursors = await self._database.run(job)
        source.shards = {stream: _Shard(cursor) for stream, cursor in cursors.items()}
        self._sources[row.uuid] = source
        if row.start != "LATEST":
            source.since_ns = 0
        for stream, _ in await self._find(source, source.since_ns, whole=True):
            self._wake(source, stream, now_s, now_ns)

    async def _look(self) -> None:
        """Of what other gateways stored nobody here is told."""
        now_s = self._clock.monotonic_s()
        if not self._database.shared or now_s - self._looked_s < LOOK_S:
            return
        self._looked_s = now_s
        now_ns = self._clock.wall_ns()
        whole = now_s - self._looked_whole_s >= DUTY_S
        self._looked_whole_s = now_s if whole else self._looked_whole_s
        for source in list(self._sources.values()):
            for stream, _ in await self._find(source, now_ns - LOOK_BACK_NS, whole=whole):
                self._wake(source, stream, now_s, now_ns)

    async def _find(self, source: _Source, since_ns: int, *, whole: bool) -> list[tuple[Stream, str]]:
        """Streams of which something was stored since; not `whole`: that is not in a segment yet."""

        def job(engine: StoreEngine) -> list[tuple[Stream, str]]:
            with engine.transaction(write=False):
                return find_streams(engine, source.arn.matches, stored_ns=since_ns, whole=whole)

        return await self._database.read(job)
