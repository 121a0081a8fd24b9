"""Event dispatch: from the thread on which something is noticed to the executor of the node that it concerns."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from metaros.executor import Mailbox, Spinnable
from metaros.node.events.callbacks import PublisherEvents, SubscriptionEvents
from metaros.node.events.event_types import Event

__all__ = ["EventDispatcher"]

_log = logging.getLogger("metaros.node")
_WAITING: Final = 256  # events of one endpoint; the totals in those that follow tell what was dropped
_EVENT_BYTES: Final = 512


class EventDispatcher:
    """Delivers events to an endpoint's callbacks, on the executor of its node."""

    def __init__(self, node: Spinnable, name: str, callbacks: PublisherEvents | SubscriptionEvents | None) -> None:
        self._name = name
        self._callbacks: dict[str, Callable[[Any], Any]] = {}
        for kind in () if callbacks is None else callbacks.__dataclass_fields__:
            callback = getattr(callbacks, kind)
            if callback is not None and kind != "group":
                self._callbacks[kind] = callback
                if inspect.iscoroutinefunction(callback):
                    node.ingress.async_work = True
        self._mailbox = Mailbox(
            self._deliver,
            owner=node,
            depth=_WAITING,
            limit_bytes=_WAITING * _EVENT_BYTES,
            size_of=lambda _: _EVENT_BYTES,
            group=None if callbacks is None else callbacks.group,
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
