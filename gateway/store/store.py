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

from gateway.store.query import (
    SeriesFacts,
    SeriesRange,
    StoredGap,
    StoredRobot,
    read_gaps,
    read_range,
    read_robots,
    read_series,
    read_streams,
    read_writers,
)
from gateway.store.retention import Retention
from gateway.store.schema import connect, migrate
from gateway.store.writer import Pace, Writer
from gateway.store.writes import StreamWrite, Write
from metaros.clock import Clock
from metaros.errors import ConfigError

__all__ = ["Store"]

Result = TypeVar("Result")


class Store:
    """One data directory: `gateway.sqlite`, the gateway's id, and a lock against a second gateway."""

    def __init__(
        self,
        data_dir: Path,
        *,
        clock: Clock,
        retention: Retention,
        queue_bytes: int,
        pace: Pace | None = None,
    ) -> None:
        data_dir.mkdir(parents=True, exist_ok=True)
        self._data_dir = data_dir
        self._lock = _lock(data_dir)
        self.gateway_id = _gateway_id(data_dir)
        connection = connect(data_dir)
        self.store_id = migrate(connection)
        self._queue_bytes = queue_bytes
        self._queued_bytes = 0
        self._room = asyncio.Event()
        self._room.set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._listener: Callable[[Sequence[Write]], None] | None = None
        self._refused_listener: Callable[[Collection[str]], None] | None = None
        self._writer = Writer(
            connection,
            clock=clock,
            on_commit=self._on_commit,
            on_refused=self._on_refused,
            retention=retention,
            pace=pace,
        )
        self._local = threading.local()
        self._readers: list[sqlite3.Connection] = []
        self._pool = ThreadPoolExecutor(max_workers=2, thread_name_prefix="gateway-read")

    @property
    def error(self) -> str | None:
        """Why commits fail now; None while they work."""
        return self._writer.error

    def start(
        self,
        listener: Callable[[Sequence[Write]], None] | None = None,
        refused: Callable[[Collection[str]], None] | None = None,
    ) -> None:
        """Start writing; in the running event loop `listener` is called with the writes of each commit, and `refused`
        with the robots whose queued writes were given up, as they cannot be committed now.
        """
        self._loop = asyncio.get_running_loop()
        self._listener = listener
        self._refused_listener = refused
        self._writer.start()

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
        await asyncio.to_thread(self._writer.close)
        self._pool.shutdown(wait=True)
        for reader in self._readers:
            reader.close()
        self._lock.close()

    async def robots(self) -> list[StoredRobot]:
        """Every robot that ever connected."""
        return await self._read(read_robots)

    async def streams(self, robot_id: str) -> dict[tuple[int, int], int]:
        """The robot's watermarks by (stream, epoch)."""
        return await self._read(lambda connection: read_streams(connection, robot_id))

    async def writers(self, robot_id: str) -> dict[int, str]:
        """Who last wrote under each of the robot's epochs."""
        return await self._read(lambda connection: read_writers(connection, robot_id))

    async def gaps(self, robot_id: str, *, limit: int) -> list[StoredGap]:
        """The robot's declared losses, the newest first."""
        return await self._read(lambda connection: read_gaps(connection, robot_id, limit=limit))

    async def series(self, robot_id: str) -> list[SeriesFacts]:
        """The robot's series with counts and newest rows."""
        return await self._read(lambda connection: read_series(connection, robot_id))

    async def range(
        self, robot_id: str, names: Sequence[str], *, start_ns: int, end_ns: int, points: int
    ) -> list[SeriesRange]:
        """Each named series between two stamps in at most `points` points."""
        return await self._read(
            lambda connection: read_range(connection, robot_id, names, start_ns=start_ns, end_ns=end_ns, points=points)
        )

    async def _read(self, job: Callable[[sqlite3.Connection], Result]) -> Result:
        return await asyncio.get_running_loop().run_in_executor(self._pool, lambda: job(self._reader()))

    def _reader(self) -> sqlite3.Connection:
        connection: sqlite3.Connection | None = getattr(self._local, "connection", None)
        if connection is None:
            connection = self._local.connection = connect(self._data_dir, read_only=True)
            self._readers.append(connection)
        return connection

    def _on_commit(self, writes: Sequence[Write]) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._committed, writes)

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

    def _committed(self, writes: Sequence[Write]) -> None:
        self._release(writes)
        if self._listener is not None:
            self._listener(writes)


def _lock(data_dir: Path) -> sqlite3.Connection:
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
