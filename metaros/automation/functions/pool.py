"""The workers of one function's version, and the calls that wait for them.

A warm worker is used again, the one that worked last first, so that the others become idle and go. Where all are busy
a call waits a moment before another worker is started for it: most calls are over sooner than a worker is there.
"""

from __future__ import annotations

import asyncio
import os
from collections import deque
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Protocol

from metaros.automation.functions.calls import FunctionSpec, Outcome
from metaros.automation.functions.errors import ENGINE_FULL, ThrottledError
from metaros.automation.functions.running_call import RunningCall
from metaros.automation.functions.runtime.runtime_api import Answer
from metaros.automation.functions.worker import InitFailure, Worker, WorkerOwner
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Pool", "PoolStatus", "WorkerQuota"]

MIB = 1024 * 1024
_CORES = os.cpu_count() or 1
_BACKOFF_S = (1.0, 60.0)  # between starts that nobody waits for, where the last one failed


@dataclass(frozen=True, slots=True, kw_only=True)
class PoolStatus:
    """A pool as it is seen. `memory_mb` is of all its workers now; `init_error` is "" where its last start was good."""

    key: str
    function: str
    version: str
    entry: str
    workers: int
    busy: int
    idle: int
    starting: int
    waiting: int
    calls: int
    cold_starts: int
    failures: int
    memory_mb: int
    init_error: str


class WorkerQuota(Protocol):
    """The engine's limits on workers, as a pool asks for them."""

    def may_start(self, pool: Pool) -> bool:
        """Whether one more worker has room; else the engine calls `grow` once it has."""

    def released(self) -> None:
        """A worker of the pool is gone, or has nothing to do."""


class Pool(WorkerOwner):
    """`launch` makes a worker that is not started yet."""

    def __init__(
        self,
        spec: FunctionSpec,
        *,
        entry: str,
        quota: WorkerQuota,
        launch: Callable[[FunctionSpec, WorkerOwner], Awaitable[Worker]],
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self.spec, self.entry = spec, entry
        self.workers: set[Worker] = set()
        self.idle: list[Worker] = []  # the last one worked last
        self.waiting: deque[RunningCall] = deque()
        self.starting = 0
        self.retired = False
        self.calls = self.cold_starts = self.failures = 0
        self.init_error = ""
        self.used_s = 0.0
        self._quota, self._launch, self._clock, self._limits = quota, launch, clock, limits
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[None]] = set()
        self._rising: set[Worker] = set()  # have not asked for a call yet
        self._closed = False
        self._patience: asyncio.TimerHandle | None = None
        self._pressed = False  # calls have waited ever since it was armed
        self._backoff_s = 0.0
        self._start_at_s = 0.0

    @property
    def size(self) -> int:
        """Workers, those included that start."""
        return len(self.workers) + self.starting

    @property
    def load(self) -> int:
        """Calls that run or wait."""
        return len(self.waiting) + sum(1 for worker in self.workers if worker.busy)

    @property
    def empty(self) -> bool:
        """Whether nothing is left of it."""
        return not self.size and not self.waiting and not self._tasks

    def submit(self, running: RunningCall) -> None:
        """Run it now, or once a worker is free.

        Raises:
            ThrottledError: too many wait.
        """
        self.used_s = running.asked_s
        if self.idle:
            self.calls += 1
            self.idle.pop().run(running)
            return
        if len(self.waiting) >= self._limits.function_waiting:
            raise ThrottledError(f"{len(self.waiting)} calls of {self.spec.name} wait already", reason=ENGINE_FULL)
        self.calls += 1
        self.waiting.append(running)
        if not self.size:
            self.grow()
        elif self._patience is None and self.size < self.spec.max_workers:
            self._arm()

    def grow(self) -> None:
        """Start a worker for each call that has waited long enough, as far as they may be. Where calls come and go
        faster than that, but some waited all the time, one more worker than before helps as long as cores are left.
        """
        since_s = self._loop.time() - self._limits.function_patience_s
        overdue = sum(1 for running in self.waiting if running.asked_s <= since_s)
        if not self.size or (self._pressed and self.size < _CORES):
            overdue = max(overdue, self.starting + 1)
        wanted = min(overdue - self.starting, self.spec.max_workers - self.size)
        for _ in range(wanted):
            if not self._begin():
                return

    def tick(self, now_s: float) -> None:
        """Once in a while: the minimum of workers, those that are idle for too long, and calls that waited too long."""
        if not self.retired and self.size < self.spec.min_workers and now_s >= self._start_at_s:
            self._begin()
        oldest_s = now_s - self._limits.function_idle_s
        while self.idle and len(self.workers) > self.spec.min_workers and self.idle[0].idle_since_s < oldest_s:
            self.evict_idle()
        latest_s = now_s - self._limits.function_wait_s
        while len(self.waiting) > self.starting and self.waiting[self.starting].asked_s < latest_s:
            running = self.waiting[self.starting]
            del self.waiting[self.starting]
            message = f"no worker of {self.spec.name} was free within {self._limits.function_wait_s:.0f} s"
            running.fail(ThrottledError(message, reason=ENGINE_FULL))

    def evict_idle(self) -> None:
        """End the worker that is idle for longest."""
        self._task(self.idle.pop(0).stop())

    def retire(self) -> None:
        """No worker any more once the calls that wait are done."""
        self.retired = True
        while self.idle:
            self.evict_idle()

    async def close(self, error: Exception) -> None:
        """End all: calls that are under way or wait get `error`."""
        self.retired = self._closed = True
        if self._patience is not None:
            self._patience.cancel()
        while self.waiting:
            self.waiting.popleft().fail(error)
        for worker in [w for w in self.workers if w.busy]:
            worker.abandon(error)
            self._task(worker.kill())
        while self.idle:
            self.evict_idle()
        for worker in [*self.workers, *self._rising]:
            self._task(worker.kill())
        while self._tasks:
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def status(self) -> PoolStatus:
        """How it is now."""
        return PoolStatus(
            key=self.spec.key,
            function=self.spec.name,
            version=self.spec.version,
            entry=self.entry,
            workers=len(self.workers),
            busy=sum(1 for worker in self.workers if worker.busy),
            idle=len(self.idle),
            starting=self.starting,
            waiting=len(self.waiting),
            calls=self.calls,
            cold_starts=self.cold_starts,
            failures=self.failures,
            memory_mb=sum(worker.memory_bytes for worker in self.workers) // MIB,
            init_error=self.init_error,
        )

    # Callbacks of workers.

    def free(self, worker: Worker) -> None:
        """It asks for a call."""
        if worker not in self.workers:
            return
        if worker.calls >= self._limits.function_calls:
            self._task(worker.stop())
        elif self.waiting:
            worker.run(self.waiting.popleft())
        elif self.retired:
            self._task(worker.stop())
        else:
            self._pressed = False
            worker.idle_since_s = self._loop.time()
            self.idle.append(worker)
            self._quota.released()

    def gone(self, worker: Worker) -> None:
        """It takes no call any more."""
        if worker not in self.workers:
            return
        self.workers.discard(worker)
        if worker in self.idle:
            self.idle.remove(worker)
        self._task(worker.over())
        self._quota.released()
        if self.waiting and not self.size:
            self.grow()

    # How workers are started.

    def _out_of_patience(self) -> None:
        self._patience = None
        if self.waiting:
            self.grow()
            if self.size < self.spec.max_workers:
                self._arm()

    def _arm(self) -> None:
        self._pressed = True  # until no call waits
        self._patience = self._loop.call_later(self._limits.function_patience_s, self._out_of_patience)

    def _begin(self) -> bool:
        if not self._quota.may_start(self):
            return False
        self.starting += 1
        self._task(self._start())
        return True

    async def _start(self) -> None:
        asked_s, began_s = self._loop.time(), self._clock.monotonic_s()
        try:
            worker = await self._up()
        except InitFailure as failure:
            self.starting -= 1
            self._failed(failure.answer, (self._clock.monotonic_s() - began_s) * 1000, asked_s)
        else:
            self.starting -= 1
            self.init_error, self._backoff_s, self._start_at_s = "", 0.0, 0.0
            self._first(worker, (self._clock.monotonic_s() - began_s) * 1000)
        finally:
            self._quota.released()

    async def _up(self) -> Worker:
        """A worker that asks for its first call: too slow a one is tried once more, as long as a call may last."""
        self.cold_starts += 1
        try:
            return await self._raise(within_s=self._limits.function_init_s)
        except InitFailure as failure:
            if not failure.timed_out or self.retired:
                raise
        return await self._raise(within_s=self.spec.timeout_s)

    async def _raise(self, *, within_s: float) -> Worker:
        worker = await self._launch(self.spec, self)
        self._rising.add(worker)
        try:
            await worker.start(within_s=0.0 if self._closed else within_s)
        except InitFailure:
            await worker.kill()
            raise
        finally:
            self._rising.discard(worker)
        return worker

    def _first(self, worker: Worker, init_ms: float) -> None:
        """Its first call pays for its start, where it waited for it."""
        self.workers.add(worker)
        if self.waiting:
            self.waiting[0].init_ms = init_ms
        self.free(worker)

    def _failed(self, answer: Answer, init_ms: float, asked_s: float) -> None:
        """No worker came of it: calls that no other worker serves have the error as their outcome."""
        self.failures += 1
        self.init_error = answer.error_type
        self._backoff_s = min(_BACKOFF_S[1], max(_BACKOFF_S[0], self._backoff_s * 2))
        self._start_at_s = self._loop.time() + self._backoff_s
        if self.size:
            return
        while self.waiting and self.waiting[0].asked_s <= asked_s:
            outcome = Outcome(payload=answer.body, error_type=answer.error_type, init_ms=init_ms)
            self.waiting.popleft().settle(outcome)
        if self.waiting:
            self.grow()

    def _task(self, work: Awaitable[None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
