"""Sporadic heartbeats of transient_local publishers: the number of the last sample, half a second after it.

A subscription that missed the last sample learns of it so, and asks for it again. The key and the payload are those of
zenoh-ext 1.10 (`advanced_publisher.rs`), which could send them itself. But then the end of a publisher waits, with
Python's lock held, for the thread of Zenoh's that tells Python of peers that leave: a peer that left at that moment
froze the program, for ten seconds or for good.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Final

import zenoh
import zenoh.ext

__all__ = ["SporadicHeartbeats"]

PERIOD_S: Final = 0.5  # rmw_zenoh's figure
_NUMBER: Final = struct.Struct("<I")
_ROUND: Final = 1 << 32  # Zenoh's numbers are of 32 bits


class SporadicHeartbeats:
    """Those of one context. A thread lives for as long as one is due, so an idle node has none. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._due: dict[zenoh.Publisher, int] = {}  # the number of the last sample, by where it is told
        self._timer: threading.Timer | None = None
        self._closed = False

    def follow(
        self, session: zenoh.Session, publisher: zenoh.ext.AdvancedPublisher
    ) -> tuple[Callable[[], None], zenoh.Publisher]:
        """What to call after each sample, and where its number is told: to be given to `leave`, then undeclared."""
        where = f"{publisher.key_expr}/@adv/pub/{publisher.id.zid}/{publisher.id.eid}/_"
        heartbeat = session.declare_publisher(
            where, congestion_control=zenoh.CongestionControl.BLOCK, priority=zenoh.Priority.DATA
        )
        count = 0

        def sent() -> None:
            nonlocal count
            with self._lock:
                self._due[heartbeat] = count
                count = (count + 1) % _ROUND
                if self._timer is None:
                    self._start()

        return sent, heartbeat

    def leave(self, heartbeat: zenoh.Publisher) -> None:
        """The publisher ends: what is due is not told any more."""
        with self._lock:
            self._due.pop(heartbeat, None)

    def close(self) -> None:
        """End the thread; the session must be closed before, so that no heartbeat blocks."""
        with self._lock:
            self._closed, timer = True, self._timer
        if timer is not None:
            timer.cancel()
            if timer is not threading.current_thread():
                timer.join()

    def _start(self) -> None:
        self._timer = None
        if self._due and not self._closed:
            timer = threading.Timer(PERIOD_S, self._report)
            timer.name, timer.daemon = "metaros-sporadic", True
            with suppress(RuntimeError):  # the interpreter ends: it begins no thread any more
                timer.start()
                self._timer = timer

    def _report(self) -> None:
        with self._lock:
            due, self._due = self._due, {}
        for heartbeat, number in due.items():
            with suppress(zenoh.ZError, RuntimeError):  # the session or the publisher was closed meanwhile
                heartbeat.put(_NUMBER.pack(number))
        with self._lock:
            self._start()
