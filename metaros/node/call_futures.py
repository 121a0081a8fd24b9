"""Futures of calls: completed on a thread of ours, since their callbacks are the user's and Zenoh's threads are not.

The same thread ends calls that are out of time.
"""

from __future__ import annotations

import heapq
import itertools
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import Future
from queue import Empty
from typing import Any

from metaros.clock import SystemClock
from metaros.concurrency.waiting import WaitQueue
from metaros.errors import MetarosError
from metaros.node.pending_call import PendingCall

__all__ = ["CallFuture", "CallFutures"]


class CallFuture(Future[Any]):
    """The response to come. Cancelling it cancels the call."""

    def __init__(self, call: PendingCall, convert: Callable[[bytes], Any]) -> None:
        super().__init__()
        self.call, self._convert = call, convert

    def cancel(self) -> bool:
        """Stop waiting; False when it is done already. The server is not told."""
        cancelled = super().cancel()
        if cancelled:
            self.call.cancel()
        return cancelled

    def complete(self) -> None:
        """Take over the outcome of the call, which has ended; does nothing where that was done."""
        if self.done() or not self.set_running_or_notify_cancel():
            return
        try:
            self.set_result(self._convert(self.call.outcome()))
        except MetarosError as error:
            self.set_exception(error)


class CallFutures:
    """A thread that completes futures, started with the first one."""

    def __init__(self, name: str) -> None:
        self._queue: WaitQueue[CallFuture | None] = WaitQueue()
        self._due: list[tuple[float, int, weakref.ref[CallFuture]]] = []  # a heap, of the thread's own
        self._order = itertools.count()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._name = f"metaros{name}-replies"

    def put(self, future: CallFuture) -> None:
        """Complete this one soon; never blocks."""
        self._queue.put(future)

    def watch(self, future: CallFuture) -> None:
        """End its call when it is out of time; starts the thread with the first one."""
        self._queue.put(future)
        with self._lock:
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()

    def close(self) -> None:
        """Complete what is there, then end the thread."""
        with self._lock:
            thread, self._thread = self._thread, None
        if thread is not None:
            self._queue.put(None)
            if thread is not threading.current_thread():
                thread.join()

    def _run(self) -> None:
        while True:
            try:
                future = self._queue.get(self._patience_s())
            except Empty:
                continue
            if future is None:
                return
            if future.call.finished:
                future.complete()
            else:
                heapq.heappush(self._due, (future.call.due_s, next(self._order), weakref.ref(future)))

    def _patience_s(self) -> float | None:
        """Until the next call is out of time; ends those that are."""
        now_s = SystemClock.monotonic_s()
        while self._due and self._due[0][0] <= now_s:
            future = heapq.heappop(self._due)[2]()
            if future is not None:
                future.call.expire()
        return min(self._due[0][0] - now_s, threading.TIMEOUT_MAX) if self._due else None
