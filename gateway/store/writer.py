"""The single writer: one thread that commits what all links have queued, then merges and purges when idle.

A failed commit (full disk, I/O error) gives up what streams had queued: their robots still have it and are told to
send it again later. What only the gateway knows (robots, writers) is kept. Until a commit works again `error` says why.
"""

from __future__ import annotations

import logging
import queue
import sqlite3
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass

from gateway.store.commit import Committer
from gateway.store.merge import merge_step, waiting_batches
from gateway.store.retention import Retention, purge_step
from gateway.store.writes import StreamWrite, Write
from metaros.clock import Clock

__all__ = ["Pace", "Writer"]

log = logging.getLogger(__name__)
_KEPT_WRITES = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """When the writer does what."""

    commit_every_s: float = 0.02  # at once when idle, never more often than this under load
    retry_every_s: float = 0.25
    commit_writes: int = 4096  # one commit's bound
    merge_at_batches: int = 512  # merge when so many batches wait,
    merge_after_s: float = 30.0  # or when one has waited so long
    merge_step_batches: int = 256
    purge_every_s: float = 60.0


class Writer:
    """Owns the writing connection; `submit` from any thread, results by `on_commit` on the writer's thread."""

    def __init__(
        self,
        connection: sqlite3.Connection,
        *,
        clock: Clock,
        on_commit: Callable[[Sequence[Write]], None],
        on_refused: Callable[[Sequence[Write]], None] = lambda writes: None,
        retention: Retention,
        pace: Pace | None = None,
    ) -> None:
        self._connection = connection
        self._clock = clock
        self._on_commit = on_commit
        self._on_refused = on_refused
        self._kept: list[Write] = []  # of commits that failed
        self._retention = retention
        self._pace = pace if pace is not None else Pace()
        self._committer = Committer(connection)
        self._queue: queue.SimpleQueue[Write | Future[None] | None] = queue.SimpleQueue()
        self._stopped = threading.Event()
        self._error: str | None = None
        self._last_commit_s = -1e9
        self._last_purge_s = clock.monotonic_s()
        self._thread = threading.Thread(target=self._run, name="gateway-store")

    @property
    def error(self) -> str | None:
        """Why the last commit failed; None while commits work."""
        return self._error

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def submit(self, write: Write) -> None:
        """Queue one write; the caller keeps the queue's bytes bounded."""
        self._queue.put(write)

    def flush(self) -> Future[None]:
        """Done when everything submitted before is committed."""
        done: Future[None] = Future()
        self._queue.put(done)
        return done

    def close(self, *, timeout_s: float = 2.0) -> None:
        """Commit what is queued, as far as the disk allows, and end the thread."""
        self._stopped.set()
        self._queue.put(None)
        if self._thread.ident is None:
            self._connection.close()
        else:
            self._thread.join(timeout_s)

    def _run(self) -> None:
        while not self._stopped.is_set():
            self._turn()
        writes, waiting, _ended = self._take(block=False)
        self._finish(writes, waiting)
        self._connection.close()

    def _turn(self) -> None:
        writes, waiting, ended = self._take(block=True)
        if writes or waiting or self._error is not None:
            self._finish(writes, waiting)
        if not ended and self._error is None:
            self._housekeeping()

    def _finish(self, writes: list[Write], waiting: list[Future[None]]) -> None:
        writes, self._kept = [*self._kept, *writes], []
        if (writes or self._error is not None) and not self._commit(writes):
            own: list[Write] = [write for write in writes if not isinstance(write, StreamWrite)]
            self._kept = own[-_KEPT_WRITES:]
            self._on_refused([write for write in writes if isinstance(write, StreamWrite)])
            for future in waiting:
                future.cancel()
            self._purge()
            self._stopped.wait(self._pace.retry_every_s)
            return
        for future in waiting:
            future.set_result(None)

    def _take(self, *, block: bool) -> tuple[list[Write], list[Future[None]], bool]:
        """Everything queued now, after waiting for the first and for the commit pace."""
        writes: list[Write] = []
        waiting: list[Future[None]] = []
        first = True
        while len(writes) < self._pace.commit_writes:
            try:
                wait_s = 1.0 if self._error is None else self._pace.retry_every_s
                item = self._queue.get(timeout=wait_s) if block and first else self._queue.get_nowait()
            except queue.Empty:
                break
            if item is None:
                return writes, waiting, True
            if isinstance(item, Future):
                waiting.append(item)
            else:
                writes.append(item)
            if block and first:
                self._stopped.wait(self._last_commit_s + self._pace.commit_every_s - self._clock.monotonic_s())
            first = False
        return writes, waiting, False

    def _commit(self, writes: list[Write]) -> bool:
        """Commit all or nothing; False when it did not work."""
        try:
            self._committer.commit(writes, now_ns=self._clock.wall_ns())
        except sqlite3.Error as error:
            if self._error is None:
                log.error("the store cannot commit; robots keep their samples meanwhile: %s", error)
            self._error = str(error)
            return False
        if self._error is not None:
            log.warning("the store commits again")
        self._error = None
        self._last_commit_s = self._clock.monotonic_s()
        self._on_commit(writes)
        return True

    def _housekeeping(self) -> None:
        try:
            count, oldest_ns = waiting_batches(self._connection)
            age_s = (self._clock.wall_ns() - oldest_ns) / 1e9
            if count >= self._pace.merge_at_batches or (count and age_s >= self._pace.merge_after_s):
                merge_step(self._connection, max_batches=self._pace.merge_step_batches)
        except sqlite3.Error as error:
            log.warning("the merge did not run: %s", error)
        if self._clock.monotonic_s() - self._last_purge_s >= self._pace.purge_every_s:
            self._purge()

    def _purge(self) -> None:
        self._last_purge_s = self._clock.monotonic_s()
        try:
            while purge_step(self._connection, self._retention, now_ns=self._clock.wall_ns()):
                if self._stopped.is_set() or not self._queue.empty():
                    break
        except sqlite3.Error as error:
            log.warning("the store could not be purged: %s", error)
