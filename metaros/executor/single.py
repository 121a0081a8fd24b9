"""The single-threaded executor: every callback of its nodes runs on the thread that spins, one at a time.

As long as all callbacks are plain functions the thread waits on the ingress itself. Once one is an `async def`, the
thread runs an asyncio event loop instead, and a pump thread tells the loop when something has arrived; plain and
async callbacks then share that loop. Callbacks of one subscription, service or timer never overlap; those of
different ones interleave only where an `async def` awaits.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Awaitable, Coroutine
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

from metaros.concurrency.signals import StopEvent
from metaros.errors import ClosedError, UsageError
from metaros.executor.ingress import Ingress
from metaros.executor.interrupts import Interrupts, interrupts
from metaros.executor.mailbox import Mailbox
from metaros.executor.protocol import Spinnable
from metaros.executor.ready_queue import ReadyQueue
from metaros.executor.switch_interval import SWITCH_INTERVAL_S, shorten_switch_interval
from metaros.executor.timers import Timer
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    import asyncio
else:
    asyncio = LazyModule("asyncio")

__all__ = ["SingleThreadedExecutor"]

_log = logging.getLogger("metaros.executor")
_SLICE: Final = 64  # items of one mailbox before timers and the others have their turn


class SingleThreadedExecutor:
    """Runs the callbacks of the nodes of one context on one thread."""

    switch_interval_s = SWITCH_INTERVAL_S
    eager_loop = (
        True  # whether an `async def` of another executor's node in the context makes this one take a loop, too
    )

    def __init__(self) -> None:
        self._ready_queue = ReadyQueue()
        self._serving: Ingress | None = None  # while it spins
        self._nodes: list[Spinnable] = []
        self._stopped = StopEvent()
        self._interrupted = Interrupts()
        self._counting = threading.Lock()
        self._spinning = threading.Lock()  # held by the thread that spins: only it may touch the loop
        self._loop: asyncio.AbstractEventLoop | None = None
        self._arrived: asyncio.Event | None = None
        self._pump: threading.Thread | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    # -- nodes -----------------------------------------------------------------------------------------------------

    def add_node(self, node: Spinnable) -> None:
        """Run this node's callbacks, too; UsageError when it belongs to another context than the others."""
        self._check_context(node)
        if node not in self._nodes:
            if self._serving is not None:
                self._serving.claim(self._ready_queue, [node])
            self._nodes.append(node)
            node.ingress.wake()

    def remove_node(self, node: Spinnable) -> None:
        """Run its callbacks no more; its samples wait within their bounds."""
        if node in self._nodes:
            self._nodes.remove(node)
            node.ingress.release(self._ready_queue, [node])

    def _members(self) -> list[Spinnable]:
        return self._nodes

    def _check_context(self, node: Spinnable) -> None:
        if any(node.ingress is not member.ingress for member in self._members()):
            raise UsageError("the nodes of one executor must share a context; use one executor a context")

    # -- spinning --------------------------------------------------------------------------------------------------

    def spin(self) -> None:
        """Run callbacks until `shutdown`, or until every node is closed.

        Ctrl-C raises KeyboardInterrupt, at the latest after the callbacks that run, whatever it interrupts.
        """
        ingress = self._begin()
        try:
            with interrupts(ingress.wake) as self._interrupted:
                while not self._stopped.is_set() and self._alive():
                    self._turn(ingress, None, forever=True)
                    self._interrupted.check()
        finally:
            self._end(ingress)

    def spin_once(self, timeout_s: float | None = None) -> bool:
        """Run what is ready, waiting up to `timeout_s` (None: for ever) for something; False when nothing came."""
        ingress = self._begin()
        try:
            return self._turn(ingress, timeout_s)
        finally:
            self._end(ingress)

    def shutdown(self) -> None:
        """Make `spin` return after the callback that runs; cancels what awaits. Safe from any thread."""
        self._stopped.set()
        for node in self._members()[:1]:
            node.ingress.wake()
        loop, arrived = self._loop, self._arrived
        if loop is not None and arrived is not None:
            with suppress(RuntimeError):  # the loop was closed meanwhile
                loop.call_soon_threadsafe(arrived.set)
        self._close_if_idle()

    def _begin(self) -> Ingress:
        if self._stopped.is_set():
            raise ClosedError("the executor was shut down")
        members = self._members()
        if not members:
            raise UsageError("the executor has no node to spin")
        ingress = members[0].ingress
        if not self._spinning.acquire(blocking=False):
            raise UsageError("another thread is spinning this executor")
        try:
            ingress.claim(self._ready_queue, self._nodes, spins=True)
        except UsageError:
            self._spinning.release()
            raise
        self._serving = ingress
        self._shorten_switch_interval()
        return ingress

    def _shorten_switch_interval(self) -> None:
        shorten_switch_interval(self.switch_interval_s)

    def _end(self, ingress: Ingress) -> None:
        self._serving = None
        ingress.release(self._ready_queue, self._nodes, spins=True)
        self._spinning.release()
        if self._stopped.is_set():
            self._close_if_idle()

    def _close_if_idle(self) -> None:
        """Close the event loop once nobody spins; who spins does it at the end."""
        if self._spinning.acquire(blocking=False):
            try:
                self._close_loop()
            finally:
                self._spinning.release()

    def _alive(self) -> bool:
        return False in [node.closed for node in self._members()]  # asked after every callback: no generator

    def _ends(self) -> bool:
        return self._stopped.is_set() or self._interrupted.seen or not self._alive()

    @property
    def stopped(self) -> bool:
        """Whether `shutdown` was called."""
        return self._stopped.is_set()

    def _wants_loop(self, ingress: Ingress) -> bool:
        return self._loop is not None or (self.eager_loop and ingress.async_work)

    def _turn(self, ingress: Ingress, timeout_s: float | None, *, forever: bool = False) -> bool:
        if not self._wants_loop(ingress):
            return self._turn_plain(ingress, timeout_s)
        loop = self._loop = self._loop or asyncio.new_event_loop()
        return loop.run_until_complete(self._turn_async(ingress, timeout_s, forever=forever))

    def _turn_plain(self, ingress: Ingress, timeout_s: float | None) -> bool:
        """One round without an event loop."""
        deadline_s = None if timeout_s is None else time.monotonic() + timeout_s
        ingress.collect()
        while not self._work(ingress):
            wait_s = self._patience_s(deadline_s)
            if wait_s is not None and wait_s <= 0 and deadline_s is not None and time.monotonic() >= deadline_s:
                return False
            ingress.wait(self._ready_queue, wait_s)
            # A stopped executor runs nothing of what is ready, which stays: without asking it would turn for ever.
            if self._ends() or (not self._ready_queue.ready and self._wants_loop(ingress)):
                return True
        return True

    def _patience_s(self, deadline_s: float | None) -> float | None:
        """How long nothing can become due by itself: until the next timer, or the caller's deadline."""
        waits: list[float] = []
        for node in self._nodes:
            due_s = node.timers.next_due_s()
            if due_s is not None and not node.timers.paused:
                waits.append(due_s - node.clock.monotonic_s())
        if deadline_s is not None:
            waits.append(deadline_s - time.monotonic())
        return max(0.0, min(waits)) if waits else None

    # -- work ------------------------------------------------------------------------------------------------------

    def _work(self, ingress: Ingress) -> bool:
        """Run what is due and ready once; False when there was nothing."""
        worked = self._run_timers()
        for mailbox in ingress.take_ready(self._ready_queue):
            if mailbox.owner in self._nodes and not self._stopped.is_set():
                worked = self._run_mailbox(mailbox) or worked
            ingress.requeue(mailbox)
            self._run_timers()
        return worked

    def _run_timers(self) -> bool:
        """Each timer that is due once: one whose callback takes longer than its period must not keep the rest out."""
        worked = False
        for node in self._nodes:
            timers = node.timers
            if timers.next_due_s() is None:
                continue
            now_s = timers.now_s()
            while not self._stopped.is_set() and (timer := timers.pop_due(now_s)) is not None:
                worked = True
                if not timer.busy:
                    self._run_timer(timer)
        return worked

    def _run_timer(self, timer: Timer) -> None:
        coroutine = self._call_timer(timer)
        if coroutine is not None:
            self._start(coroutine, timer)

    @staticmethod
    def _call_timer(timer: Timer) -> Coroutine[Any, Any, Any] | None:
        try:
            result = timer.callback()
        except Exception:
            _log.exception("a timer's callback failed")
            return None
        return result if result is not None and asyncio.iscoroutine(result) else None

    def _run_mailbox(self, mailbox: Mailbox, limit: int = _SLICE) -> bool:
        """Handle a slice of its backlog; handlers log what user callbacks raise."""
        pending, handle, worked = mailbox.pending, mailbox.handle, False
        for _ in range(min(len(pending), limit)):
            if mailbox.busy:
                break
            if mailbox.late_s:
                mailbox.drop_late()
            try:
                item = pending.popleft()
            except IndexError:  # the relief thread dropped it meanwhile
                break
            worked = True
            try:
                result = handle(item)
            except Exception:
                _log.exception("the handler of a sample failed")
                continue
            if result is not None and asyncio.iscoroutine(result):
                self._start(result, mailbox)
        return worked

    # -- async callbacks -------------------------------------------------------------------------------------------

    def _start(self, coroutine: Coroutine[Any, Any, Any], owner: Mailbox | Timer, *, counted: bool = False) -> None:
        """Let a coroutine run on the loop; its owner gets no other call until it is done. `counted`: it is already."""
        loop = self._loop = self._loop or asyncio.new_event_loop()
        if not counted:
            self._count(owner, 1)
        task = loop.create_task(self._finish(coroutine, owner))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _count(self, owner: Mailbox | Timer, step: int) -> None:
        """So many more calls of it are not done."""
        with self._counting:
            owner.running += step
            owner.busy = owner.running >= (1 if owner.group is None else owner.group.overlap)

    async def _finish(self, coroutine: Awaitable[Any], owner: Mailbox | Timer) -> None:
        try:
            await coroutine
        except Exception:
            _log.exception("an async callback failed")
        finally:
            self._count(owner, -1)
            ingress = self._nodes[0].ingress if self._nodes else None
            if isinstance(owner, Mailbox) and ingress is not None and not owner.queued:
                ingress.requeue(owner)
            if self._arrived is not None:
                self._arrived.set()

    async def _turn_async(self, ingress: Ingress, timeout_s: float | None, *, forever: bool) -> bool:
        """One round on the event loop, or all until the end; coroutines go on in every round."""
        deadline_s = None if timeout_s is None else time.monotonic() + timeout_s
        arrived = self._arrived = self._arrived or asyncio.Event()
        self._start_pump(ingress, asyncio.get_running_loop(), arrived)
        while True:
            arrived.clear()
            worked = self._work(ingress)
            await asyncio.sleep(0)
            if self._ends() or (worked and not forever):
                return True
            if worked:
                continue
            wait_s = self._patience_s(deadline_s)
            if deadline_s is not None and time.monotonic() >= deadline_s:
                return False
            try:
                async with asyncio.timeout(wait_s):
                    await arrived.wait()
            except TimeoutError:
                continue

    def _start_pump(self, ingress: Ingress, loop: asyncio.AbstractEventLoop, arrived: asyncio.Event) -> None:
        if self._pump is not None:
            return

        def pump() -> None:
            while not self._stopped.is_set():
                ingress.wait(self._ready_queue, None)
                try:
                    loop.call_soon_threadsafe(arrived.set)
                except RuntimeError:  # the loop was closed
                    return

        self._pump = threading.Thread(target=pump, name="metaros-pump", daemon=True)
        self._pump.start()

    def _close_loop(self) -> None:
        """Cancel what awaits, end the pump, close the loop."""
        loop, self._loop = self._loop, None
        if loop is None:
            return
        loop.run_until_complete(self._cancel_tasks())
        if self._pump is not None and self._nodes:
            self._nodes[0].ingress.wake()
            self._pump.join()
        loop.close()

    async def _cancel_tasks(self) -> None:
        tasks = list(self._tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
