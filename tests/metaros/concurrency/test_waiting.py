"""Waits that end in time: queues, wakeups and pauses, whatever signals come."""

from __future__ import annotations

import itertools
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import Empty
from types import CodeType

import pytest

from metaros.concurrency.waiting import WaitQueue, Wakeup, pause
from metaros.executor.ingress import Ingress
from metaros.executor.ready_queue import ReadyQueue
from tests.support.nodes.interrupts import interrupt_at

TIMEOUT_S = 0.02


@contextmanager
def a_handler_outlives(wait_s: float) -> Iterator[None]:
    """A signal comes shortly before a wait of so long is over, and its handler takes until after that."""

    def busy(*_: object) -> None:
        until_s = time.monotonic() + wait_s
        while time.monotonic() < until_s:
            pass

    before = signal.signal(signal.SIGUSR1, busy)
    comes = threading.Timer(wait_s * 0.7, signal.pthread_kill, (threading.get_ident(), signal.SIGUSR1))
    comes.start()
    try:
        yield
    finally:
        comes.join()
        signal.signal(signal.SIGUSR1, before)


def test_a_queue_gives_in_order_and_ends_in_time() -> None:
    queue = WaitQueue[int]()
    assert queue.empty()
    for item in range(3):
        queue.put(item)
    assert not queue.empty()
    assert [queue.get(), queue.get(0), queue.get_nowait()] == [0, 1, 2]
    for refused in (lambda: queue.get(-1), lambda: queue.get(0), queue.get_nowait, lambda: queue.get(0.001)):
        with pytest.raises(Empty):
            refused()


def test_a_queue_waits_for_whoever_puts() -> None:
    queue, got = WaitQueue[int](), list[int]()
    thread = threading.Thread(target=lambda: got.extend(queue.get(wait_s) for wait_s in (None, 60, None)))
    thread.start()
    for item in range(3):
        queue.put(item)
    thread.join(60)
    assert got == [0, 1, 2]


def test_a_wakeup_is_taken_back_by_the_wait() -> None:
    wakeup = Wakeup()
    assert not wakeup.wait(0)
    wakeup.set()
    wakeup.set()
    assert wakeup.wait()
    assert not wakeup.wait(-1)


def ingress_wait() -> None:
    """As an executor waits for its next timer."""
    ingress = Ingress()
    ingress.add_chore(lambda: None)  # its relief thread runs
    try:
        ingress.wait(ReadyQueue(), TIMEOUT_S)
    finally:
        ingress.close()


def queue_wait() -> None:
    """Until nothing came."""
    with pytest.raises(Empty):
        WaitQueue[int]().get(TIMEOUT_S)


@pytest.mark.parametrize(
    "wait", [queue_wait, lambda: Wakeup().wait(TIMEOUT_S), lambda: pause(TIMEOUT_S), ingress_wait],
    ids=["queue", "wakeup", "pause", "executor"],
)  # fmt: skip
def test_a_wait_ends_although_a_handler_outlives_it(wait: Callable[[], object]) -> None:
    """Python's own SimpleQueue would wait for ever."""
    with a_handler_outlives(TIMEOUT_S):
        began_s = time.monotonic()
        wait()
    assert time.monotonic() - began_s > TIMEOUT_S * 0.9


@pytest.mark.parametrize("code", [pause.__code__, threading.Condition.wait.__code__], ids=["pause", "condition"])
def test_ctrl_c_ends_a_pause_at_any_moment(code: CodeType) -> None:
    """Python's own event may say "release unlocked lock" instead."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for step in itertools.count():
        try:
            assert not interrupt_at(step, code, lambda: pause(0.001)), "Ctrl-C was lost"
        except KeyboardInterrupt:
            continue
        assert (step > 5) is (code is pause.__code__), "it was interrupted there, and it waits for no event"
        break
