"""Threads of dedicated subscriptions, whose callbacks do not wait for the executor."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable
from typing import Any, Final, TypeVar

import zenoh

from metaros.executor import Ingress, Mailbox

__all__ = ["ChannelThread", "RingThread", "feed", "handle_each"]

T = TypeVar("T")
_CHANNEL: Final = 1024  # samples
_PATIENCE_S: Final = 0.1  # a handler may block for so long before its channel is emptied for it
_AHEAD: Final = 512  # samples that a thread passes on before the executor must have handled half of them
_YIELD_S: Final = 0.0003
_BATCH: Final = 512  # at most: while a full channel is emptied one by one, each sample wakes Zenoh's thread
_BATCH_S: Final = 0.005  # what handling a batch should not take longer than
_FLOOD: Final = 8  # samples at once that mean more are on their way


class RingThread:
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

    def take_turns(self, turn: threading.Lock) -> None:
        """From the next sample on handle none while another thread that takes turns does."""
        self._handle = _in_turn(self._handle, turn)

    def stop(self) -> None:
        """End the thread; the subscriber must be undeclared before."""
        self._stopped = True
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self, ring: Any) -> None:
        receive, try_receive = ring.recv, ring.try_recv
        while not self._stopped:
            try:
                sample = receive()
                while sample is not None and not self._stopped:
                    self._handle(sample)
                    sample = try_receive()
            except zenoh.ZError:  # undeclared
                return


class ChannelThread:
    """Keep-all: a channel in Zenoh's own memory that makes publishers wait for a while rather than lose a sample.

    A thread hands the samples to `handle`. While that blocks for longer than `_PATIENCE_S`, a guard moves what arrives
    into the mailbox, bounded in bytes: a full channel would stall everything else on the link, and end it in seconds.
    """

    def __init__(self, handle: Callable[[list[zenoh.Sample]], None], backlog: Mailbox, *, name: str) -> None:
        self.handler: Any = zenoh.handlers.FifoChannel(_CHANNEL)
        self._handle = handle
        self._backlog = backlog
        self._lock = threading.Lock()
        self._receiving = False
        self._handled = 0
        self._stopped = threading.Event()
        self._threads: list[threading.Thread] = []
        self._name = name

    def start(self, subscriber: Any) -> None:
        """Begin to handle what arrives."""
        channel = subscriber.handler
        for suffix, run in (("", self._run), ("-guard", self._guard)):
            thread = threading.Thread(target=run, args=(channel,), name=f"{self._name}{suffix}", daemon=True)
            self._threads.append(thread)
            thread.start()

    def take_turns(self, turn: threading.Lock) -> None:
        """From the next batch on handle none while another thread that takes turns does."""
        self._handle = _in_turn(self._handle, turn)

    def stop(self) -> None:
        """End both threads; the subscriber must be undeclared before."""
        self._stopped.set()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join()

    def _run(self, channel: Any) -> None:
        receive, stopped, pause = channel.recv, self._stopped.is_set, threading.Event()
        flood, limit = False, 1
        try:
            while not stopped():
                batch = self._here(channel, limit)
                if not batch and flood:  # let a batch gather: switching threads for every sample costs more
                    self._receiving = flood = False
                    pause.wait(_YIELD_S)
                    continue
                if not batch:
                    batch = [receive()]
                    self._receiving = False
                else:
                    flood = len(batch) > _FLOOD
                self._handled += 1
                began_s = time.monotonic()
                self._handle(batch)
                quick = time.monotonic() - began_s < _BATCH_S
                limit = min(limit * 2, _BATCH) if quick else max(limit // 2, 1)
        except zenoh.ZError:  # undeclared
            return

    def _here(self, channel: Any, limit: int) -> list[zenoh.Sample]:
        """The oldest samples that are here; without any, the guard leaves the channel alone from now on."""
        with self._lock:
            pending = self._backlog.pending
            if pending:
                return [pending.popleft() for _ in range(min(len(pending), limit))]
            batch = list(itertools.islice(iter(channel.try_recv, None), limit))
            self._receiving = not batch
            return batch

    def _guard(self, channel: Any) -> None:
        seen = -1
        while not self._stopped.wait(_PATIENCE_S):
            while self._handled == seen and not self._receiving and not self._stopped.is_set():
                try:
                    if not self._relieve(channel):
                        break
                except zenoh.ZError:
                    return
            seen = self._handled

    def _relieve(self, channel: Any) -> bool:
        """Move up to one channel's worth; False when the channel was empty."""
        with self._lock:
            if self._receiving:
                return False
            for _ in range(_CHANNEL):
                sample = channel.try_recv()
                if sample is None:
                    return False
                self._backlog.pending.append(sample)
            self._backlog.trim()
            return True


def _in_turn(handle: Callable[[T], object], turn: threading.Lock) -> Callable[[T], None]:
    def handle_in_turn(item: T) -> None:
        with turn:
            handle(item)

    return handle_in_turn


def handle_each(handle: Callable[[zenoh.Sample], object]) -> Callable[[list[zenoh.Sample]], None]:
    """A handler that processes the samples on the dedicated thread itself."""

    def handle_all(batch: list[zenoh.Sample]) -> None:
        for sample in batch:
            handle(sample)

    return handle_all


def feed(ingress: Ingress, mailbox: Mailbox, lane_stopped: Callable[[], bool]) -> Callable[[list[zenoh.Sample]], None]:
    """A handler that passes samples on to an executor, and waits while that has enough to do."""
    pause = threading.Event()
    pending, limit_bytes = mailbox.pending, mailbox.limit_bytes

    def pass_on(batch: list[zenoh.Sample]) -> None:
        pending.extend(batch)
        if not mailbox.queued:
            ingress.offer(mailbox)
        ahead = min(_AHEAD, limit_bytes // mailbox.size_of(batch[-1]))
        if len(pending) >= ahead:
            while len(pending) > ahead // 2 and not lane_stopped():
                pause.wait(_YIELD_S)

    return pass_on
