"""The store as the rest of the gateway sees it: submit writes, wait for room, read off the event loop."""

from __future__ import annotations

import asyncio
import secrets
import sqlite3
import threading
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

from gateway.domain.sample import Gap
from gateway.store.commit import CommitHook
from gateway.store.engine import StoreEngine
from gateway.store.engines import open_engine
from gateway.store.objects import ObjectStore
from gateway.store.retention import Retention
from gateway.store.telemetry.compact import CompactPace
from gateway.store.telemetry.compactor import Compactor
from gateway.store.telemetry.history import (
    StoredTopic,
    TopicGap,
    find_runs,
    gaps_between,
    newest_candidates,
    stored_topics,
)
from gateway.store.telemetry.load import RunLoader
from gateway.store.telemetry.query import (
    SeriesFacts,
    StoredGap,
    StoredRobot,
    read_gaps,
    read_robots,
    read_series,
    read_streams,
    read_writers,
)
from gateway.store.telemetry.samples import SampleFilter, StoredBatch, StoredRun
from gateway.store.telemetry.series import Method, SeriesRange, read_metric_gaps, read_range
from gateway.store.writer import Pace, Writer
from gateway.store.writes import Committed, StreamWrite, Write
from metaros.clock import Clock
from metaros.errors import ConfigError

__all__ = ["Store", "lock_folder"]

Result = TypeVar("Result")
CLOSE_S = 2.0


class Store:
    """A data directory with the gateway's id and a lock against a second gateway; the database is in it or at `url`."""

    def __init__(
        self,
        data_dir: Path,
        *,
        clock: Clock,
        retention: Retention,
        queue_bytes: int,
        url: str = "",
        pace: Pace | None = None,
        objects: ObjectStore | None = None,
        compact: CompactPace | None = None,
    ) -> None:
        data_dir.mkdir(parents=True, exist_ok=True)
        self._lock = lock_folder(data_dir)
        self.gateway_id = _gateway_id(data_dir)
        try:
            self._engine, self.store_id = open_engine(url, data_dir)
        except BaseException:
            self._lock.close()
            raise
        self._queue_bytes = queue_bytes
        self._queued_bytes = 0
        self._room = asyncio.Event()
        self._room.set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._listener: Callable[[Committed], None] | None = None
        self._refused_listener: Callable[[Collection[str]], None] | None = None
        self._ahead_listener: Callable[[Sequence[Write]], None] | None = None
        self._writer = Writer(
            self._engine,
            clock=clock,
            on_commit=self._on_commit,
            on_refused=self._on_refused,
            ahead=self._on_ahead,
            retention=retention,
            pace=pace,
            name=self.gateway_id,
        )
        self._loader = RunLoader(objects)
        self._compactor: Compactor | None = None
        if objects is not None:
            self._compactor = Compactor(
                self._writer,
                self._engine.reader,
                objects,
                clock=clock,
                name=self.gateway_id,
                pace=compact,
                shared=self._engine.shared,
            )
        self._local = threading.local()
        self._readers: list[StoreEngine] = []
        self._pool = ThreadPoolExecutor(max_workers=2, thread_name_prefix="gateway-read")
        # Loading may wait for a network: the pages of everybody else must not wait behind it.
        self._loads = ThreadPoolExecutor(max_workers=4, thread_name_prefix="gateway-load")

    @property
    def shared(self) -> bool:
        """Whether other gateways may write to the same database."""
        return self._engine.shared

    @property
    def queued_bytes(self) -> int:
        """What waits for its commit."""
        return self._queued_bytes

    @property
    def error(self) -> str | None:
        """Why commits fail now; None while they work."""
        return self._writer.error

    @property
    def objects_error(self) -> str | None:
        """Why messages cannot be moved to the object store now; None while they can, or there is none."""
        return self._compactor.error if self._compactor is not None else None

    def start(
        self,
        listener: Callable[[Committed], None] | None = None,
        refused: Callable[[Collection[str]], None] | None = None,
        ahead: Callable[[Sequence[Write]], None] | None = None,
        commit_hook: CommitHook | None = None,
    ) -> None:
        """Start writing; in the running event loop `listener` is told of each commit, and `refused` the robots
        whose queued writes were given up, as they cannot be committed now. `ahead` gets, on the writer's thread, what
        the next commit will try to store; it must not raise. `commit_hook` takes part in every commit, likewise.
        """
        self._loop = asyncio.get_running_loop()
        self._listener = listener
        self._refused_listener = refused
        self._ahead_listener = ahead
        self._writer.start(commit_hook)
        if self._compactor is not None:
            self._compactor.start()

    def submit(self, write: Write) -> None:
        """Queue a write from the event loop's thread. Callers of much wait for `room()` first."""
        self._queued_bytes += write.size_bytes
        if self._queued_bytes > self._queue_bytes:
            self._room.clear()
        self._writer.submit(write)

    async def room(self, *, timeout_s: float) -> bool:
        """Wait until the queue is under its bound; False when it still is not after `timeout_s`."""
        if self._room.is_set():
            return True
        try:
            async with asyncio.timeout(timeout_s):
                await self._room.wait()
        except TimeoutError:
            return False
        return True

    async def flush(self) -> None:
        """Return when everything submitted before is committed."""
        await asyncio.wrap_future(self._writer.flush())

    async def close(self) -> None:
        """Commit what is queued and close every connection."""
        if self._compactor is not None:
            await asyncio.to_thread(self._compactor.close, timeout_s=CLOSE_S)
        await asyncio.to_thread(self._writer.close, timeout_s=CLOSE_S)
        ending = asyncio.create_task(asyncio.to_thread(self._end_reading))
        await asyncio.wait({ending}, timeout=CLOSE_S)
        if ending.done():
            await asyncio.to_thread(self._close_readers)
        self._lock.close()

    async def robots(self) -> list[StoredRobot]:
        """Every robot that ever connected."""
        return await self.read(read_robots)

    async def streams(self, robot_id: str) -> dict[tuple[int, int], int]:
        """The robot's watermarks by (stream, epoch)."""
        return await self.read(lambda engine: read_streams(engine, robot_id))

    async def writers(self, robot_id: str) -> dict[int, str]:
        """Who last wrote under each of the robot's epochs."""
        return await self.read(lambda engine: read_writers(engine, robot_id))

    async def gaps(self, robot_id: str, *, limit: int) -> list[StoredGap]:
        """The robot's declared losses, the newest first."""
        return await self.read(lambda engine: read_gaps(engine, robot_id, limit=limit))

    async def samples(
        self, robot_id: str, wanted: SampleFilter | None = None, *, limit: int = 1000
    ) -> list[StoredBatch]:
        """At most `limit` runs of the robot's messages with what they hold, by stream, epoch and number."""

        def job(engine: StoreEngine) -> list[StoredBatch]:
            runs = find_runs(engine, robot_id, wanted or SampleFilter(), limit=limit)
            runs.sort(key=lambda run: (run.stream_id, run.epoch, run.first_seq))
            return [self._loader.load(engine, run) for run in runs]

        return await self._load(job)

    async def runs(
        self, robot_id: str, wanted: SampleFilter | None = None, *, limit: int = 1000, newest_first: bool = False
    ) -> list[StoredRun]:
        """At most `limit` runs of the robot's messages, of one moment: by lowest stamp, or by highest, descending."""
        some = wanted or SampleFilter()
        return await self.read(lambda engine: find_runs(engine, robot_id, some, limit=limit, newest_first=newest_first))

    async def load(self, run: StoredRun) -> StoredBatch:
        """A run's samples; PurgedError, DamagedError or StoreError when they cannot be had."""
        return await self._load(lambda engine: self._loader.load(engine, run))

    async def newest(self, robot_id: str, topic: str, t_ns: int, *, max_age_ns: int | None = None) -> StoredRun | None:
        """The run that holds the topic's newest sample at or before `t_ns`, if that is no older than `max_age_ns`."""
        return await self._load(
            lambda engine: self._loader.newest(
                engine, newest_candidates(engine, robot_id, topic, t_ns), t_ns, max_age_ns=max_age_ns
            )
        )

    async def stored_topics(self, robot_id: str) -> list[StoredTopic]:
        """Every topic of which messages of the robot are stored, by name."""
        return await self.read(lambda engine: stored_topics(engine, robot_id))

    async def gaps_between(self, robot_id: str, *, start_ns: int, end_ns: int, limit: int = 1000) -> list[TopicGap]:
        """The robot's declared losses that touch the time between two stamps, the newest first."""
        return await self.read(
            lambda engine: gaps_between(engine, robot_id, start_ns=start_ns, end_ns=end_ns, limit=limit)
        )

    async def series(self, robot_id: str) -> list[SeriesFacts]:
        """The robot's series with counts and newest rows."""
        return await self.read(lambda engine: read_series(engine, robot_id))

    async def range(
        self,
        robot_id: str,
        names: Sequence[str],
        *,
        start_ns: int,
        end_ns: int,
        points: int,
        method: Method = "buckets",
    ) -> list[SeriesRange]:
        """Each named series between two stamps in at most `points` points."""
        span = {"start_ns": start_ns, "end_ns": end_ns, "points": points}
        return await self.read(lambda engine: read_range(engine, robot_id, names, **span, method=method))

    async def metric_gaps(self, robot_id: str, *, start_ns: int, end_ns: int, limit: int) -> list[Gap]:
        """The declared losses of the robot's metric rows that touch the time between two stamps."""
        span = {"start_ns": start_ns, "end_ns": end_ns, "limit": limit}
        return await self.read(lambda engine: read_metric_gaps(engine, robot_id, **span))

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """Do `job` in one write transaction on the writer's thread; its error when nothing of it happened."""
        return await asyncio.wrap_future(self._writer.run(job))

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """Run a query on a thread; StoreError when the database cannot be read now."""
        return await asyncio.get_running_loop().run_in_executor(self._pool, lambda: job(self._reader()))

    async def read_slowly(self, job: Callable[[StoreEngine], Result]) -> Result:
        """The same for what may wait for the object store: the pages of others do not wait behind it."""
        return await self._load(job)

    async def _load(self, job: Callable[[StoreEngine], Result]) -> Result:
        """The same for what may ask the object store, on threads of its own."""
        return await asyncio.get_running_loop().run_in_executor(self._loads, lambda: job(self._reader()))

    def _reader(self) -> StoreEngine:
        reader: StoreEngine | None = getattr(self._local, "reader", None)
        if reader is None:
            reader = self._local.reader = self._engine.reader()
            self._readers.append(reader)
        return reader

    def _end_reading(self) -> None:
        self._loads.shutdown(cancel_futures=True)
        self._pool.shutdown(cancel_futures=True)

    def _close_readers(self) -> None:
        for reader in self._readers:
            reader.close()

    def _on_commit(self, done: Committed) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._committed, done)

    def _on_ahead(self, writes: Sequence[Write]) -> None:
        """On the writer's thread."""
        if self._ahead_listener is not None:
            self._ahead_listener(writes)

    def _on_refused(self, writes: Sequence[Write]) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._refused, writes)

    def _refused(self, writes: Sequence[Write]) -> None:
        self._release(writes)
        if self._refused_listener is not None:
            self._refused_listener({write.robot for write in writes if isinstance(write, StreamWrite)})

    def _release(self, writes: Sequence[Write]) -> None:
        self._queued_bytes -= sum(write.size_bytes for write in writes)
        if self._queued_bytes <= self._queue_bytes:
            self._room.set()

    def _committed(self, done: Committed) -> None:
        self._release(done.writes)
        if self._listener is not None:
            self._listener(done)


def lock_folder(data_dir: Path) -> sqlite3.Connection:
    """Hold the directory for this process; the lock goes with the process, however it ends."""
    lock = sqlite3.connect(data_dir / "gateway.lock", isolation_level=None, timeout=0.5, check_same_thread=False)
    try:
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.OperationalError as error:
        lock.close()
        raise ConfigError(f"another gateway uses the data directory {data_dir}; give this one its own") from error
    return lock


def _gateway_id(data_dir: Path) -> str:
    path = data_dir / "gateway-id"
    if not path.exists():
        path.write_text(secrets.token_hex(16) + "\n")
    return path.read_text().strip()
