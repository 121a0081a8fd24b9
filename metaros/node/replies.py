"""Futures of calls: completed on a thread of ours, since their callbacks are the user's and Zenoh's threads are not."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any

from metaros.errors import MetarosError
from metaros.node.call import Call

__all__ = ["CallFuture", "Replies"]


class CallFuture(Future[Any]):
    """The response to come. Cancelling it cancels the call."""

    def __init__(self, call: Call, convert: Callable[[bytes], Any]) -> None:
        super().__init__()
        self._call, self._convert = call, convert

    def cancel(self) -> bool:
        """Stop waiting; False when it is done already. The server is not told."""
        cancelled = super().cancel()
        if cancelled:
            self._call.cancel()
        return cancelled

    def complete(self) -> None:
        """Take over the outcome of the call, which has ended."""
        if not self.set_running_or_notify_cancel():
            return
        try:
            self.set_result(self._convert(self._call.outcome()))
        except MetarosError as error:
            self.set_exception(error)


class Replies:
    """A thread that completes futures, started with the first one."""

    def __init__(self, name: str) -> None:
        self._queue: SimpleQueue[CallFuture | None] = SimpleQueue()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._name = f"metaros{name}-replies"

    def put(self, future: CallFuture) -> None:
        """Complete this one soon; never blocks."""
        self._queue.put(future)

    def start(self) -> None:
        """Make sure that the thread runs."""
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
        while (future := self._queue.get()) is not None:
            future.complete()
