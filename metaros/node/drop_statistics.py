"""Queue and drop statistics of a context's subscriptions, served on request, for example to `metaros top`.

A query on `@metaros/<domain>/<zid>/subscriptions` is answered with a JSON list, one object a subscription. Nothing is
sent while nobody asks, and no thread waits for it: the ingress's relief thread looks, and an answer has a thread of its
own for as long as it takes, so that neither Zenoh's threads nor an executor's are held up by who asks.
"""

from __future__ import annotations

import itertools
import json
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

import zenoh

from metaros.executor import Ingress
from metaros.limits import LIMITS
from metaros.wire import WireSession

__all__ = ["DropStatistics", "drops_key"]

_QUERIES: Final = 8  # that wait; the oldest gets no answer
_JOIN_S: Final = 1.0
Row = Callable[[], dict[str, object]]


def drops_key(domain: int, zid: str = "*") -> str:
    """Where one context answers, or all of a domain."""
    return f"@metaros/{domain}/{zid}/subscriptions"


class DropStatistics:
    """Serves the statistics of one context's subscriptions, each by a function that returns its row. Thread-safe."""

    def __init__(self, session: WireSession, ingress: Ingress) -> None:
        self._session = session
        self._ingress = ingress
        self._key = drops_key(session.domain, session.zid)
        self._lock = threading.Lock()
        self._rows: dict[Row, None] = {}
        self._queryable: Any = None
        self._answering: threading.Thread | None = None

    def add(self, row: Row) -> None:
        """Include this one."""
        with self._lock:
            self._rows[row] = None
            if self._queryable is None:
                handler: Any = zenoh.handlers.RingChannel(_QUERIES)
                self._queryable = self._session.check_open().declare_queryable(self._key, handler, complete=True)
                self._ingress.add_chore(self._look)

    def discard(self, row: Row) -> None:
        """The reverse of `add`."""
        with self._lock:
            self._rows.pop(row, None)

    def rows(self) -> list[dict[str, object]]:
        """One row a subscription, in the order in which they were made."""
        with self._lock:
            rows = list(itertools.islice(self._rows, LIMITS.subscription_rows))
        return [row() for row in rows]

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
