"""The context's Zenoh subscribers: one a key, shared by all subscriptions on it, feeding the ingress."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import zenoh
import zenoh.ext

from metaros.executor import Ingress, Mailbox
from metaros.wire import QoSProfile, Reliability, WireSession

__all__ = ["KeySubscribers", "declare_with_history"]


class KeySubscribers:
    """Zenoh subscribers by key. Thread-safe."""

    def __init__(self, session: WireSession, ingress: Ingress) -> None:
        self._session = session
        self._ingress = ingress
        self._lock = threading.Lock()
        self._subscribers: dict[str, zenoh.Subscriber[None]] = {}

    def listen(self, key: str, mailbox: Mailbox) -> Callable[[], None]:
        """Deliver what arrives on `key` to the mailbox; returns how to stop that."""
        expression = zenoh.KeyExpr(key)
        with self._lock:
            self._ingress.route(expression, mailbox)
            if key not in self._subscribers:
                callback = zenoh.handlers.Callback(self._ingress.put, indirect=False)
                self._subscribers[key] = self._session.check_open().declare_subscriber(key, callback)
        return lambda: self._leave(key, expression, mailbox)

    def _leave(self, key: str, expression: zenoh.KeyExpr, mailbox: Mailbox) -> None:
        with self._lock:
            if self._ingress.unroute(expression, mailbox):
                subscriber = self._subscribers.pop(key)
                with suppress(zenoh.ZError):  # the session went first
                    subscriber.undeclare()  # type: ignore[no-untyped-call]


def declare_with_history(
    session: zenoh.Session, key: str, qos: QoSProfile, handler: Any, *, remote_only: bool = False
) -> zenoh.ext.AdvancedSubscriber[Any]:
    """A subscriber that also gets what transient_local publishers keep, set up as rmw_zenoh does."""
    recovery = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
    return zenoh.ext.declare_advanced_subscriber(
        session,
        key,
        handler,
        allowed_origin=zenoh.Locality.REMOTE if remote_only else zenoh.Locality.ANY,
        history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=qos.depth),
        recovery=recovery if qos.reliability is not Reliability.BEST_EFFORT else None,
        subscriber_detection=True,
    )
