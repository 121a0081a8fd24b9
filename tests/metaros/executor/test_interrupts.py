"""Ctrl-C while an executor spins, also where the KeyboardInterrupt itself was swallowed."""

from __future__ import annotations

import signal
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

import metaros
from metaros.executor import AsyncioExecutor, FairExecutor, MultiThreadedExecutor, SingleThreadedExecutor
from metaros.executor.interrupts import interrupts


def swallow() -> None:
    """What a library's callback and a destructor do."""
    with suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("make", [SingleThreadedExecutor, FairExecutor])
@pytest.mark.parametrize("through_loop", [False, True])
def test_a_swallowed_interrupt_ends_the_spin(make: Callable[[], Any], through_loop: bool) -> None:
    async def swallow_later() -> None:
        swallow()

    with metaros.Context(domain_id=0, connect=[]) as context, metaros.Node("n", context=context) as node:
        node.create_timer(0.001, swallow_later if through_loop else swallow)
        executor = make()
        executor.add_node(node)
        with pytest.raises(KeyboardInterrupt):
            executor.spin()
        executor.shutdown()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_it_wakes_one_that_waits() -> None:
    """With callbacks on other threads the one that spins sleeps: the handler runs there, and is swallowed there."""
    woken: list[bool] = []
    with interrupts(lambda: woken.append(True)) as note:
        note.check()
        swallow()
        assert woken == [True]
        with pytest.raises(KeyboardInterrupt):
            note.check()


def test_spin_returns() -> None:
    with metaros.Context(domain_id=0, connect=[]) as context, metaros.Node("n", context=context) as node:
        node.create_timer(0.001, swallow)
        metaros.spin(node)


def test_a_programs_own_handler_stays() -> None:
    received: list[int] = []

    def own(number: int, _: object) -> None:
        received.append(number)

    before = signal.signal(signal.SIGINT, own)
    try:
        with interrupts(lambda: None) as note:
            assert signal.getsignal(signal.SIGINT) is own
            signal.raise_signal(signal.SIGINT)
        assert (received, note.seen) == ([signal.SIGINT], False)
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_handler_set_meanwhile_stays() -> None:
    with interrupts(lambda: None):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def test_the_others_are_made_of_the_same() -> None:
    assert issubclass(MultiThreadedExecutor, SingleThreadedExecutor)
    assert issubclass(AsyncioExecutor, SingleThreadedExecutor)
