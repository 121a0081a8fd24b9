"""The multi-threaded executor: plain callbacks on a pool of threads, as their callback groups allow.

The thread that spins only hands out work and runs what `async def` callbacks await. Callbacks without a group of their
own belong to one mutually exclusive group a node: nodes run beside each other, the callbacks of one node do not.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import deque
from collections.abc import Coroutine
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Final

from metaros.errors import UsageError
from metaros.executor.groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from metaros.executor.ingress import Ingress
from metaros.executor.mailbox import Mailbox
from metaros.executor.protocol import Spinnable
from metaros.executor.single import SingleThreadedExecutor
from metaros.executor.timers import Timer
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    import asyncio
else:
    asyncio = LazyModule("asyncio")

__all__ = ["MultiThreadedExecutor"]

_log = logging.getLogger("metaros.executor")
_SLICE: Final = 64  # items of one mailbox before the others of its group have their turn
_JOIN_S: Final = 2.0  # callbacks that take longer are left to their daemon threads: the end never waits for them


class _Job:
    """A timer's call, or a mailbox's next items. A mailbox has one job at a time, which is passed on."""

    __slots__ = ("group", "source")

    def __init__(self, source: Mailbox | Timer, group: CallbackGroup) -> None:
        self.source = source
        self.group = group

    @property
    def exclusive(self) -> bool:
        """Whether calls of the source must not overlap."""
        return self.group.overlap == 1


class MultiThreadedExecutor(SingleThreadedExecutor):
    """Runs the callbacks of the nodes of one context on `threads` threads: by default as many as there are CPUs.

    `spin_once` hands out what is ready and does not wait for it.
    """

    def __init__(self, *, threads: int | None = None) -> None:
        super().__init__()
        if threads is not None and threads < 1:
            raise UsageError(f"an executor needs a thread or more, not {threads}")
        self.threads = max(2, os.cpu_count() or 2) if threads is None else threads
        self._jobs: SimpleQueue[_Job | None] = SimpleQueue()
        self._coroutines: deque[tuple[Coroutine[Any, Any, Any], _Job]] = deque()  # one a job at most
        self._groups: dict[object, CallbackGroup] = {}
        self._workers: list[threading.Thread] = []

    def remove_node(self, node: Spinnable) -> None:
        """Run its callbacks no more; its samples wait within their bounds."""
        super().remove_node(node)
        self._groups.pop(node, None)

    def _begin(self) -> Ingress:
        ingress = super()._begin()
        while len(self._workers) < self.threads:
            name = f"metaros-worker-{len(self._workers)}"
            thread = threading.Thread(target=self._labour, name=name, daemon=True)
            self._workers.append(thread)
            thread.start()
        return ingress

    # -- handing out -----------------------------------------------------------------------------------------------

    def _work(self, ingress: Ingress) -> bool:
        worked = bool(self._coroutines)
        while self._coroutines:
            coroutine, job = self._coroutines.popleft()
            # Counted twice for a moment, a mailbox would look full, and be left with a place free.
            counted = not job.exclusive and isinstance(job.source, Mailbox)
            self._start(self._until_done(coroutine, job), job.source, counted=counted)
        for node in list(self._nodes):
            now_s = node.clock.monotonic_s()
            while not self._stopped.is_set() and (timer := node.timers.pop_due(now_s)) is not None:
                worked = True
                if not timer.busy:
                    self._count(timer, 1)
                    self._submit(_Job(timer, self._group_of(timer, node)))
        for mailbox in ingress.take_ready(self._ready_queue):
            worked = True
            self._submit(_Job(mailbox, self._group_of(mailbox, mailbox.owner)))
        return worked

    def _group_of(self, source: Mailbox | Timer, node: object) -> CallbackGroup:
        if source.group is not None:
            return source.group
        group = self._groups.get(node)
        if group is None:
            group = self._groups[node] = MutuallyExclusiveCallbackGroup()
        return group

    def _submit(self, job: _Job) -> None:
        if job.group.enter(job):
            self._jobs.put(job)

    # -- working ---------------------------------------------------------------------------------------------------

    def _labour(self) -> None:
        while (job := self._jobs.get()) is not None:
            if self._stopped.is_set():
                self._done(job)
            elif isinstance(job.source, Timer):
                self._after(self._call_timer(job.source), job)
            elif job.exclusive:
                self._after(self._handle_slice(job.source), job)
            else:
                self._handle_one(job.source, job)

    def _handle_slice(self, mailbox: Mailbox) -> Coroutine[Any, Any, Any] | None:
        """Some items, up to the first that awaits."""
        for _ in range(min(len(mailbox.pending), _SLICE)):
            if mailbox.busy or self._stopped.is_set():
                break
            coroutine = self._handle_next(mailbox)
            if coroutine is not None:
                return coroutine
        return None

    def _handle_one(self, mailbox: Mailbox, job: _Job) -> None:
        """One item, after the next was left to another thread."""
        if mailbox.busy:
            _ingress_of(mailbox).requeue(mailbox, wake_executor=True)
            return
        self._count(mailbox, 1)  # before the next may be taken: so many at most are under way
        item = _take(mailbox)
        if item is not None and mailbox.pending:
            self._jobs.put(job)
        else:
            _ingress_of(mailbox).requeue(mailbox, wake_executor=True)
        coroutine = None if item is None else _handle(mailbox, item)
        if coroutine is not None:
            self._hand_over(coroutine, _Job(mailbox, job.group))
        else:
            self._count(mailbox, -1)
            if mailbox.pending:
                _ingress_of(mailbox).offer(mailbox)

    def _handle_next(self, mailbox: Mailbox) -> Coroutine[Any, Any, Any] | None:
        item = _take(mailbox)
        return None if item is None else _handle(mailbox, item)

    def _after(self, coroutine: Coroutine[Any, Any, Any] | None, job: _Job) -> None:
        if coroutine is None:
            self._done(job)
        else:
            self._hand_over(coroutine, job)

    def _hand_over(self, coroutine: Coroutine[Any, Any, Any], job: _Job) -> None:
        """Only the thread that spins may touch the event loop."""
        self._coroutines.append((coroutine, job))
        for node in self._nodes[:1]:
            node.ingress.wake()

    async def _until_done(self, coroutine: Coroutine[Any, Any, Any], job: _Job) -> None:
        try:
            await coroutine
        finally:
            if job.exclusive or isinstance(job.source, Timer):
                self._done(job)

    def _done(self, job: _Job) -> None:
        """Give the source back, and its place in the group to the next in line."""
        if isinstance(job.source, Timer):
            self._count(job.source, -1)
        else:
            _ingress_of(job.source).requeue(job.source, wake_executor=True)
        following = job.group.leave()
        if following is not None:
            self._jobs.put(following)

    # -- the end ---------------------------------------------------------------------------------------------------

    def _close_loop(self) -> None:
        workers, self._workers = self._workers, []
        for _ in workers:
            self._jobs.put(None)
        end_s = time.monotonic() + _JOIN_S
        for thread in workers:
            if thread is not threading.current_thread():
                thread.join(max(0.0, end_s - time.monotonic()))
        super()._close_loop()
        while self._coroutines:
            coroutine, job = self._coroutines.popleft()
            coroutine.close()
            if job.exclusive or isinstance(job.source, Timer):
                self._done(job)
            else:
                self._count(job.source, -1)
        while True:  # what was still handed out goes back to its mailboxes
            try:
                left = self._jobs.get_nowait()
            except Empty:
                return
            if left is not None:
                self._done(left)


def _ingress_of(mailbox: Mailbox) -> Ingress:
    """Where the mailbox's items come in."""
    ingress: Ingress = mailbox.owner.ingress  # type: ignore[attr-defined]
    return ingress


def _take(mailbox: Mailbox) -> Any:
    if mailbox.late_s:
        mailbox.drop_late()
    try:
        return mailbox.pending.popleft()
    except IndexError:
        return None


def _handle(mailbox: Mailbox, item: Any) -> Coroutine[Any, Any, Any] | None:
    try:
        result = mailbox.handle(item)
    except Exception:
        _log.exception("the handler of a sample failed")
        return None
    return result if result is not None and asyncio.iscoroutine(result) else None
