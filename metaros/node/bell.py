"""The bell beside a channel of Zenoh's: a subscriber of the same key that only says that something came."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import zenoh

from metaros.errors import ClosedError

__all__ = ["Bell"]


class Bell:
    """`declare()` makes the subscriber. No peer is told of it while the channel's own is there. Thread-safe."""

    def __init__(self, declare: Callable[[], Any]) -> None:
        self._declare = declare
        self._lock = threading.Lock()
        self._subscriber: Any = declare()
        self._closed = False

    def turn(self, on: bool) -> None:
        """On or off."""
        with self._lock, suppress(ClosedError, zenoh.ZError):  # the session goes
            if on and self._subscriber is None and not self._closed:
                self._subscriber = self._declare()
            elif not on and self._subscriber is not None:
                subscriber, self._subscriber = self._subscriber, None
                subscriber.undeclare()

    def close(self) -> None:
        """Off for good."""
        self._closed = True
        self.turn(False)
