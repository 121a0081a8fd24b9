"""The single writer: one thread that commits what all links have queued, then merges and purges when idle.

A failed commit (full disk, I/O error, a mistake of ours) gives up what streams had queued: their robots still have it
and are told to send it again later. What only the gateway knows (robots, writers) is kept. Until a commit works again
`error` says why. Whatever else changes the database (compaction, recordings) is a job that runs here between commits.
"""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, TypeVar

from gateway.errors import StoreError, UnstorableError
from gateway.store.commit import CommitHook, Committer
from gateway.store.engine import StoreEngine
from gateway.store.purge import Purge
from gateway.store.retention import Retention
from gateway.store.telemetry.levels import LevelBuilder
from gateway.store.telemetry.merge import Merge, do_merge, merge_step, plan_merge, waiting_batches
from gateway.store.writes import Committed, RobotWrite, StreamWrite, Write
from metaros.clock import Clock
from metaros.concurrency.waiting import WaitQueue

__all__ = ["Pace", "Writer"]

log = logging.getLogger(__name__)
Result = TypeVar("Result")
_KEPT_WRITES = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """When the writer does what."""

    commit_every_s: float = 0.02  # at once when idle, never more often than this under load
    retry_every_s: float = 0.25
    commit_writes: int = 4096  # one commit's bounds
    commit_bytes: int = 32 << 20
    merge_at_batches: int = 512  # merge when so many batches wait,
    merge_after_s: float = 30.0  # or when one has waited so long
    merge_look_every_s: float = 0.05
    merge_step_batches: int = 256
    merge_behind_batches: int = 4096  # nothing is committed before fewer wait
    levels_every_s: float = 60.0
    purge_every_s: float = 60.0
    rescue_every_s: float = 5.0  # the same while commits fail: the disk may be full


@dataclass(slots=True)
class _Job:
    """Something else to do in a transaction of its own."""

    call: Callable[[StoreEngine], Any]
    done: Future[Any] = field(default_factory=Future)

    def refuse(self, reason: str) -> None:
        """It will not be done."""
        if self.done.set_running_or_notify_cancel():
            self.done.set_exception(StoreError(reason))

    def run(self, engine: StoreEngine) -> None:
        """Do it, whatever comes of it."""
        if not self.done.set_running_or_notify_cancel():
            return
        try:
            with engine.transaction(write=True):
                result = self.call(engine)
        except Exception as error:  # the writer outlives every job; whoever asked for it is told
            self.done.set_exception(error)
        else:
            self.done.set_result(result)


@dataclass(slots=True)
class _Round:
    """What was taken from the queue at once."""

    writes: list[Write] = field(default_factory=list)
    waiting: list[Future[None]] = field(default_factory=list)
    jobs: list[_Job] = field(default_factory=list)
    ended: bool = False


class Writer:
    """Owns the writing engine; `submit` from any thread, results by `on_commit` on the writer's thread."""

    def __init__(
        self,
        engine: StoreEngine,
        *,
        clock: Clock,
        on_commit: Callable[[Committed], None],
        on_refused: Callable[[Sequence[Write]], None] = lambda writes: None,
        ahead: Callable[[Sequence[Write]], None] = lambda writes: None,
        retention: Retention,
        pace: Pace | None = None,
        name: str = "",
    ) -> None:
        self._engine = engine
        self._clock = clock
        self._on_commit = on_commit
        self._on_refused = on_refused
        self._ahead = ahead
        self._kept: list[Write] = []  # of commits that failed
        self._retention = retention
        self._pace = pace if pace is not None else Pace()
        self._committer = Committer(engine, name=name)
        self._queue: WaitQueue[Write | Future[None] | _Job | None] = WaitQueue()
        self._stopped = threading.Event()
        self._error: str | None = None
        self._last_commit_s = -1e9
        self._last_look_s = -1e9
        self._merging = False
        self._last_purge_s = self._last_levels_s = clock.monotonic_s()
        self._levels: LevelBuilder | None = None  # the round that is not over
        # A database that hangs must not keep the program from ending.
        self._thread = threading.Thread(target=self._run, name="gateway-store", daemon=True)

    @property
    def error(self) -> str | None:
        """Why the last commit failed; None while commits work."""
        return self._error

    def start(self, commit_hook: CommitHook | None = None) -> None:
        """Start the thread; `commit_hook` takes part in every commit."""
        self._committer.commit_hook = commit_hook
        self._thread.start()

    def submit(self, write: Write) -> None:
        """Queue one write; the caller keeps the queue's bytes bounded."""
        self._queue.put(write)

    def flush(self) -> Future[None]:
        """Done when everything submitted before is committed."""
        done: Future[None] = Future()
        self._queue.put(done)
        return done

    def run(self, call: Callable[[StoreEngine], Result]) -> Future[Result]:
        """Do `call` in one transaction between two commits; its result, or its error when nothing of it happened."""
        job = _Job(call)
        if self._stopped.is_set():
            job.refuse("the store is closing")
        else:
            self._queue.put(job)
        return job.done

    def close(self, *, timeout_s: float = 2.0) -> None:
        """Commit what is queued, as far as the disk allows, and end the thread."""
        self._stopped.set()
        self._queue.put(None)
        if self._thread.ident is None:
            self._engine.close()
        else:
            self._thread.join(timeout_s)

    def _run(self) -> None:
        while not self._stopped.is_set():
            try:
                self._round()
            except Exception:  # a mistake of ours must not end what acknowledges every robot's samples
                log.exception("the store's writer failed; it goes on")
                self._stopped.wait(self._pace.retry_every_s)
        try:
            self._end()
        finally:
            self._engine.close()

    def _end(self) -> None:
        """What was queued before the end, as far as commits work."""
        ended = False
        while not ended and self._error is None:
            taken = self._take(block=False)
            ended = taken.ended or self._queue.empty()
            self._finish(taken)
        while not self._queue.empty():
            left = self._queue.get_nowait()
            if isinstance(left, _Job):
                left.refuse("the store is closing")

    def _round(self) -> None:
        taken = self._take(block=True)
        if taken.writes or taken.waiting or taken.jobs or self._error is not None:
            self._finish(taken)
        if not taken.ended and self._error is None:
            self._housekeeping()

    def _finish(self, taken: _Round) -> None:
        self._ahead(taken.writes)
        writes, self._kept = [*self._kept, *taken.writes], []
        if (writes or self._error is not None) and not self._commit(writes):
            self._give_up(writes)
            for future in taken.waiting:
                future.cancel()
            for job in taken.jobs:
                job.refuse(f"the store cannot commit: {self._error}")
            if self._clock.monotonic_s() - self._last_purge_s >= self._pace.rescue_every_s:
                self._purge()
            self._stopped.wait(self._pace.retry_every_s)
            return
        for future in taken.waiting:
            if future.set_running_or_notify_cancel():
                future.set_result(None)
        for job in taken.jobs:
            job.run(self._engine)

    def _give_up(self, writes: Sequence[Write]) -> None:
        """Streams' writes come again from their robots; what only the gateway knows is kept for the next commit."""
        own = [write for write in writes if not isinstance(write, StreamWrite)]
        self._kept = [*self._kept, *own][-_KEPT_WRITES:]
        self._on_refused([write for write in writes if isinstance(write, StreamWrite)])

    def _take(self, *, block: bool) -> _Round:
        """Everything queued now, after waiting for the first and for the commit pace."""
        taken = _Round()
        first, size_bytes = True, 0
        while len(taken.writes) < self._pace.commit_writes and size_bytes < self._pace.commit_bytes:
            try:
                wait_s = 1.0 if self._error is None else self._pace.retry_every_s
                item = self._queue.get(wait_s) if block and first else self._queue.get_nowait()
            except queue.Empty:
                break
            if item is None:
                taken.ended = True
                break
            if isinstance(item, Future):
                taken.waiting.append(item)
            elif isinstance(item, _Job):
                taken.jobs.append(item)
                break  # what was submitted before it is committed before it
            else:
                taken.writes.append(item)
                size_bytes += item.size_bytes
            if block and first:
                self._stopped.wait(self._last_commit_s + self._pace.commit_every_s - self._clock.monotonic_s())
            first = False
        return taken

    def _commit(self, writes: list[Write]) -> bool:
        """Commit all or nothing; False when it did not work."""
        try:
            done = self._committer.commit(writes, now_ns=self._clock.wall_ns())
        except UnstorableError as error:
            return self._commit_by_robot(writes, error)
        except StoreError as error:
            return self._failed(error)
        except Exception as error:  # a mistake of ours, in what one robot sends or in all of it
            if self._error is None:
                log.exception("a commit failed in a way that nobody foresaw")
            return self._commit_by_robot(writes, error) if writes else self._failed(error)
        if self._error is not None:
            log.warning("the store commits again")
        self._error = None
        self._last_commit_s = self._clock.monotonic_s()
        self._on_commit(done)
        return True

    def _failed(self, error: Exception) -> bool:
        if self._error is None:
            log.error("the store cannot commit; robots keep their samples meanwhile: %s", error)
        self._error = str(error) or type(error).__name__
        return False

    def _commit_by_robot(self, writes: Sequence[Write], error: Exception) -> bool:
        """Some robot's write cannot be stored whatever the disk does: the other robots must not wait for it."""
        robots: dict[str, list[Write]] = {}
        for write in writes:
            robots.setdefault(write.robot.id if isinstance(write, RobotWrite) else write.robot, []).append(write)
        if len(robots) == 1:
            log.error("what robot %s sends cannot be stored: %s", next(iter(robots)), error)
            self._on_refused(writes)
            return True
        for some in robots.values():
            if not self._commit(some):
                self._give_up(some)
        return True

    def _housekeeping(self) -> None:
        now_s = self._clock.monotonic_s()
        if now_s - self._last_look_s >= self._pace.merge_look_every_s:
            self._last_look_s = now_s
            self._merge()
        if self._levels is not None or now_s - self._last_levels_s >= self._pace.levels_every_s:
            self._make_levels(now_s)
        if now_s - self._last_purge_s >= self._pace.purge_every_s:
            self._purge()

    def _merge(self) -> None:
        """Have a step of the merge planned beside the commits, or do it here where the backlog grows all the same.

        In a shared store it is all done here: two gateways would plan the same.
        """
        try:
            count, oldest_ns = waiting_batches(self._engine)
            age_s = (self._clock.wall_ns() - oldest_ns) / 1e9
            while count >= self._pace.merge_at_batches or (count and age_s >= self._pace.merge_after_s):
                if not self._engine.shared and count < self._pace.merge_behind_batches:
                    self._plan_merge()
                    break
                count -= merge_step(self._engine, max_batches=self._pace.merge_step_batches)
                if self._stopped.is_set() or (not self._queue.empty() and count < self._pace.merge_behind_batches):
                    break
        except StoreError as error:
            log.warning("the merge did not run: %s", error)
        except Exception:
            log.exception("the merge failed in a way that nobody foresaw")
            self._last_look_s = self._clock.monotonic_s() + self._pace.merge_after_s

    def _plan_merge(self) -> None:
        if not self._merging:
            self._merging = True
            # A disk that hangs must not keep the program from ending.
            threading.Thread(target=self._planned, name="gateway-merge", daemon=True).start()

    def _planned(self) -> None:
        """On a thread of its own: plan a step on a snapshot, and queue it."""
        merge: Future[Merge] = Future()
        try:
            reader = self._engine.reader()
            try:
                with reader.transaction(write=False):
                    merge.set_result(plan_merge(reader, max_batches=self._pace.merge_step_batches))
            finally:
                reader.close()
        except Exception as error:
            merge.set_exception(error)
        self.run(lambda engine: do_merge(engine, merge.result())).add_done_callback(self._merged)

    def _merged(self, done: Future[int]) -> None:
        """A step is done, or not; the next one need not wait."""
        self._merging = False
        error = done.exception() if not done.cancelled() else None
        if error is None:
            self._last_look_s = -1e9
        elif not isinstance(error, StoreError):
            log.error("the merge failed in a way that nobody foresaw", exc_info=error)
            self._last_look_s = self._clock.monotonic_s() + self._pace.merge_after_s
        elif self._error is None and not self._stopped.is_set():
            log.warning("the merge did not run: %s", error)

    def _make_levels(self, now_s: float) -> None:
        """Begin a round, or go on with it, for as long as nobody waits for a commit."""
        if self._levels is None:
            self._levels, self._last_levels_s = LevelBuilder(self._engine, now_ns=self._clock.wall_ns()), now_s
        try:
            while self._levels.step():
                if self._stopped.is_set() or not self._queue.empty():
                    return
        except StoreError as error:
            log.warning("levels were not made: %s", error)
        except Exception:
            log.exception("levels were not made, for a reason that nobody foresaw")
        self._levels = None

    def _purge(self) -> None:
        self._last_purge_s = self._clock.monotonic_s()
        purge = Purge(self._engine, self._retention, now_ns=self._clock.wall_ns())
        try:
            while purge.step():
                if self._stopped.is_set() or not self._queue.empty():
                    break
        except StoreError as error:
            log.log(logging.WARNING if self._error is None else logging.DEBUG, "the store was not purged: %s", error)
