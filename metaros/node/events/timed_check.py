"""A check that runs on the node's executor when a deadline or a lease is due."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Final

from metaros.executor import Mailbox, Timer
from metaros.node.core import NodeCore

__all__ = ["TimedCheck"]

_ITEM_BYTES: Final = 512
_SHORTEST_S: Final = 0.001


class TimedCheck:
    """Runs `check(now_s)` on the executor; it returns when it wants to run again, None for not before `reschedule`.

    It goes by the context's clock: promises between programs hold in real time, whatever time a simulation shows.
    """

    def __init__(self, node: NodeCore, check: Callable[[float], float | None]) -> None:
        self._node = node
        self._check = check
        self._lock = threading.Lock()
        self._timer: Timer | threading.Timer | None = None
        self._closed = False
        mailbox = Mailbox(lambda _: self._ring(), owner=node, depth=1, limit_bytes=_ITEM_BYTES, size_of=lambda _: 1)
        self._put = node.ingress.put_to(mailbox)

    def reschedule(self) -> None:
        """Check soon: what the next check depends on has changed. Any thread may."""
        self._put(None)

    def close(self) -> None:
        """Never check again."""
        with self._lock:
            self._closed = True
            if self._timer is not None:
                self._timer.cancel()

    def _ring(self) -> None:
        """Each turn is a timer of its own: the next is due when the last sample says, not a fixed period on."""
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            if self._closed:
                return
            now_s = self._node.context.clock.monotonic_s()
            due_s = self._check(now_s)
            if due_s is not None:
                self._set(max(due_s - now_s, _SHORTEST_S))

    def _set(self, delay_s: float) -> None:
        node = self._node
        if node.clock is node.context.clock:
            self._timer = node.timers.add(delay_s, self._ring)
            return
        timer = self._timer = threading.Timer(delay_s, self.reschedule)  # the node's own timers run by simulated time
        timer.daemon = True
        timer.start()
