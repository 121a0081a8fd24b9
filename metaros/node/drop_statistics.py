"""What waits for each subscription of a context and what it dropped, told to whoever asks, such as `metaros top`.

A query on `@metaros/<domain>/<zid>/subscriptions` is answered with a JSON list, one object a subscription. Nothing is
sent while nobody asks, and no thread waits for it: the ingress's relief thread looks, and an answer has a thread of its
own for as long as it takes, so that neither Zenoh's threads nor an executor's are held up by who asks.
"""

from __future__ import annotations

import itertools
import json
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

import zenoh

from metaros.executor import Ingress
from metaros.limits import LIMITS
from metaros.wire import WireSession

if TYPE_CHECKING:
    from metaros.node.subscription import Subscription

__all__ = ["Drops", "drops_key"]

_QUERIES: Final = 8  # that wait; the oldest gets no answer
_WEIGHED: Final = 256  # items of a queue whose size is looked at; the rest is taken to be like them
_JOIN_S: Final = 1.0


def drops_key(domain: int, zid: str = "*") -> str:
    """Where one context answers, or all of a domain."""
    return f"@metaros/{domain}/{zid}/subscriptions"


class Drops:
    """The subscriptions of one context. Thread-safe."""

    def __init__(self, session: WireSession, ingress: Ingress) -> None:
        self._session = session
        self._ingress = ingress
        self._key = drops_key(session.domain, session.zid)
        self._lock = threading.Lock()
        self._subscriptions: dict[Subscription, None] = {}
        self._queryable: Any = None
        self._answering: threading.Thread | None = None

    def add(self, subscription: Subscription) -> None:
        """Tell of this one, too."""
        with self._lock:
            self._subscriptions[subscription] = None
            if self._queryable is None:
                handler: Any = zenoh.handlers.RingChannel(_QUERIES)
                self._queryable = self._session.check_open().declare_queryable(self._key, handler, complete=True)
                self._ingress.also(self._look)

    def discard(self, subscription: Subscription) -> None:
        """The reverse of `add`."""
        with self._lock:
            self._subscriptions.pop(subscription, None)

    def rows(self) -> list[dict[str, object]]:
        """One row a subscription, in the order in which they were made."""
        with self._lock:
            subscriptions = list(itertools.islice(self._subscriptions, LIMITS.subscription_rows))
        return [_row(subscription) for subscription in subscriptions]

    def close(self) -> None:
        """Answer no more; called before the session closes."""
        answering = self._answering
        if answering is not None:
            answering.join(_JOIN_S)

    def _look(self) -> None:
        """On the relief thread: quick."""
        if self._session.closed or (self._answering is not None and self._answering.is_alive()):
            return
        with suppress(zenoh.ZError):  # the session is being closed
            query = self._queryable.handler.try_recv()
            if query is not None:
                self._answering = threading.Thread(
                    target=self._answer, args=(query,), name="metaros-drops", daemon=True
                )
                self._answering.start()

    def _answer(self, query: Any) -> None:
        with suppress(zenoh.ZError):
            while query is not None:
                query.reply(self._key, json.dumps(self.rows()))
                query.drop()
                query = self._queryable.handler.try_recv()


def _row(subscription: Subscription) -> dict[str, object]:
    queues = [list(mailbox.pending) for mailbox in subscription.mailboxes]  # copied in one step of the interpreter
    return {
        "node": subscription.node.full_name,
        "topic": subscription.topic,
        "depth": subscription.mailboxes[0].depth,
        "queued": sum(map(len, queues)) if subscription.mailboxes_hold_all else None,
        "queued_bytes": sum(map(_weight, queues)) if subscription.mailboxes_hold_all else None,
        "dropped": subscription.dropped,
        "lost": subscription.lost,
        "expired": subscription.expired,
        "malformed": subscription.malformed,
    }


def _weight(items: list[zenoh.Sample]) -> int:
    newest = items[-_WEIGHED:]
    return sum(len(item.payload) for item in newest) * len(items) // max(1, len(newest))
