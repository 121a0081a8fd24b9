"""Critical nodes: each on a thread of its own, in the real-time class where the operating system allows it."""

from __future__ import annotations

import logging
import threading
from typing import Final

from metaros.executor.protocol import Spinnable
from metaros.executor.realtime import make_realtime
from metaros.executor.single import SingleThreadedExecutor

__all__ = ["CriticalThread"]

_log = logging.getLogger("metaros.executor")
_JOIN_S: Final = 2.0  # a callback that takes longer is left to its daemon thread: the program's end never waits for it


class _CriticalExecutor(SingleThreadedExecutor):
    """Takes an event loop only once a callback of its own awaits: waiting on the ingress itself is quicker."""

    eager_loop = False


class CriticalThread:
    """Spins one node. `realtime_error`: why it has no real-time class; empty when it has, None before it starts."""

    def __init__(self, node: Spinnable, *, quiet: bool) -> None:
        self.node = node
        self.realtime_error: str | None = None
        self._quiet = quiet
        self._executor = _CriticalExecutor()
        self._executor.add_node(node)
        self._thread: threading.Thread | None = None
        self._ready = threading.Event()

    def start(self) -> None:
        """Begin, unless begun before."""
        if self._thread is None:
            name = f"metaros-critical{getattr(self.node, 'full_name', '')}"
            self._thread = threading.Thread(target=self._run, name=name, daemon=True)
            self._thread.start()
            self._ready.wait()

    def stop(self) -> None:
        """End after the callback that runs. Safe from any thread and from signal handlers."""
        self._executor.shutdown()

    def join(self) -> None:
        """Wait for the end, but not for a callback that blocks for long."""
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(_JOIN_S)

    def _run(self) -> None:
        try:
            self.realtime_error = make_realtime()
            if self.realtime_error and not self._quiet:
                _log.warning("a critical node runs at ordinary priority: %s", self.realtime_error)
        finally:
            self._ready.set()
        if not self._executor.stopped:
            self._executor.spin()
