"""Threads of dedicated subscriptions: how samples reach a callback that does not wait for the executor."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import zenoh

from metaros.executor import Ingress, Mailbox

__all__ = ["IngressLane", "RingLane"]


class RingLane:
    """Keep-last: Zenoh's own ring of `depth` samples, emptied by one thread without a Python call on Zenoh's side.

    What the ring overwrites never reaches Python, so it counts as lost (by sequence number), not as dropped.
    """

    def __init__(self, handle: Callable[[zenoh.Sample], object], *, depth: int, name: str) -> None:
        self.handler: Any = zenoh.handlers.RingChannel(depth)
        self._handle = handle
        self._name = name
        self._stopped = False
        self._thread: threading.Thread | None = None

    def start(self, subscriber: Any) -> None:
        """Begin to handle what the subscriber's ring holds."""
        self._thread = threading.Thread(target=self._run, args=(subscriber.handler,), name=self._name, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread; the subscriber must be undeclared before."""
        self._stopped = True
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self, ring: Any) -> None:
        receive, try_receive, handle = ring.recv, ring.try_recv, self._handle
        while not self._stopped:
            try:
                sample = receive()
                while sample is not None and not self._stopped:
                    handle(sample)
                    sample = try_receive()
            except zenoh.ZError:  # undeclared
                return


class IngressLane:
    """Keep-all: an ingress of its own, so that the backlog is bounded in bytes even while the callback blocks."""

    def __init__(self, mailbox: Mailbox, *, name: str) -> None:
        self._ingress = Ingress(name=f"{name}-relief")
        self._mailbox = mailbox
        self._stopped = False
        self.handler: Any = zenoh.handlers.Callback(self._ingress.put, indirect=False)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self, subscriber: Any) -> None:
        """Begin to handle what arrives."""
        self._ingress.route(subscriber.key_expr, self._mailbox)
        self._thread.start()

    def stop(self) -> None:
        """End both threads."""
        self._stopped = True
        self._ingress.wake()
        if self._thread is not threading.current_thread():
            self._thread.join()
        self._ingress.close()

    def _run(self) -> None:
        pending, handle = self._mailbox.pending, self._mailbox.handle
        while not self._stopped:
            self._ingress.wait(None)
            for mailbox in self._ingress.take_ready():
                while pending and not self._stopped:
                    self._ingress.collect()
                    handle(pending.popleft())
                self._ingress.requeue(mailbox)
