"""The post: from whatever thread something is noticed on, to the executor of the node that it concerns."""

from __future__ import annotations

import inspect
import logging
import threading
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from metaros.executor import Mailbox, Timer
from metaros.node.events.callbacks import PublisherEvents, SubscriptionEvents
from metaros.node.events.kinds import Event

if TYPE_CHECKING:
    from metaros.node.node import Node

__all__ = ["Alarm", "Post"]

_log = logging.getLogger("metaros.node")
_WAITING: Final = 256  # events of one endpoint; the totals in those that follow tell what was dropped
_EVENT_BYTES: Final = 512
_SHORTEST_S: Final = 0.001


class Post:
    """Delivers events to an endpoint's callbacks."""

    def __init__(self, node: Node, name: str, callbacks: PublisherEvents | SubscriptionEvents | None) -> None:
        self._name = name
        self._callbacks: dict[str, Callable[[Any], Any]] = {}
        for kind in () if callbacks is None else callbacks.__dataclass_fields__:
            callback = getattr(callbacks, kind)
            if callback is not None:
                self._callbacks[kind] = callback
                if inspect.iscoroutinefunction(callback):
                    node.ingress.async_work = True
        self._mailbox = Mailbox(
            self._deliver,
            owner=node,
            depth=_WAITING,
            limit_bytes=_WAITING * _EVENT_BYTES,
            size_of=lambda _: _EVENT_BYTES,
        )
        self._put = node.ingress.put_to(self._mailbox) if self._callbacks else None

    def wants(self, kind: str) -> bool:
        """Whether there is a callback for such events."""
        return kind in self._callbacks

    def send(self, kind: str, event: Event) -> bool:
        """Have the callback called with the event; False when there is none."""
        callback = self._callbacks.get(kind)
        if callback is None or self._put is None:
            return False
        self._put(partial(callback, event))
        return True

    def close(self) -> None:
        """Forget what waits."""
        self._mailbox.clear()

    def _deliver(self, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except Exception:
            _log.exception("an event callback of %s failed", self._name)
            return None


class Alarm:
    """Runs `check(now_s)` on the executor; it returns when it wants to run again, None for not until `kick`.

    It goes by the context's clock: promises between programs hold in real time, whatever time a simulation shows.
    """

    def __init__(self, node: Node, check: Callable[[float], float | None]) -> None:
        self._node = node
        self._check = check
        self._lock = threading.Lock()
        self._timer: Timer | threading.Timer | None = None
        self._closed = False
        mailbox = Mailbox(lambda _: self._ring(), owner=node, depth=1, limit_bytes=_EVENT_BYTES, size_of=lambda _: 1)
        self._put = node.ingress.put_to(mailbox)

    def kick(self) -> None:
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
        timer = self._timer = threading.Timer(delay_s, self.kick)  # the node's own timers run by simulated time
        timer.daemon = True
        timer.start()
