"""Being asked to end: by the loop's own handlers, and where it has none."""

from __future__ import annotations

import asyncio
import os
import signal
import threading
from collections.abc import Callable, Iterator

import pytest

from metaros.concurrency.signals import StopEvent, on_stop, stop_signals
from tests.support.nodes.interrupts import interrupt_at


class LoopWithoutHandlers(asyncio.SelectorEventLoop):
    """As on Windows."""

    def add_signal_handler(self, sig: int, callback: Callable[..., object], *args: object) -> None:
        """Refuse."""
        raise NotImplementedError


@pytest.fixture(autouse=True)
def own_handlers() -> Iterator[None]:
    """Put back what a test replaces."""
    before = {number: signal.getsignal(number) for number in stop_signals(hangup=True)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("loop_class", [asyncio.SelectorEventLoop, LoopWithoutHandlers])
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_each_signal_stops(loop_class: type[asyncio.AbstractEventLoop], name: str) -> None:
    async def main() -> None:
        stop = asyncio.Event()
        on_stop(asyncio.get_running_loop(), stop.set, hangup=True)
        os.kill(os.getpid(), getattr(signal, name))
        assert await asyncio.wait_for(stop.wait(), 60)

    with asyncio.Runner(loop_factory=loop_class) as runner:
        runner.run(main())


def test_a_late_signal_after_the_loop_is_nobody_s() -> None:
    reported = list[str]()
    with asyncio.Runner(loop_factory=LoopWithoutHandlers) as runner:

        async def main() -> None:
            on_stop(asyncio.get_running_loop(), lambda: reported.append("to stop"))

        runner.run(main())
    os.kill(os.getpid(), signal.SIGTERM)
    assert reported == []


def test_a_closed_terminal_counts_only_when_asked_for() -> None:
    assert signal.SIGHUP not in stop_signals()
    assert signal.SIGHUP in stop_signals(hangup=True)


@pytest.mark.parametrize("method", ["wait", "set"])
def test_a_handler_may_set_a_stop_event_at_any_moment(method: str) -> None:
    """Python's own event would wait for itself where the signal comes while its lock is held."""
    step, more = 0, True
    while more:
        stop = StopEvent()
        signal.signal(signal.SIGINT, lambda *_, event=stop: event.set())
        call = stop.set if method == "set" else lambda event=stop: event.wait(0.001)
        more = interrupt_at(step, getattr(StopEvent, method).__code__, call)
        assert stop.is_set() is (more or method == "set")
        assert stop.wait(0) is stop.is_set()
        step += 1
    assert step > 5


def test_a_stop_event_wakes_all_who_wait() -> None:
    stop, answers = StopEvent(), list[bool]()
    threads = [threading.Thread(target=lambda: answers.append(stop.wait(60))) for _ in range(4)]
    for thread in threads:
        thread.start()
    assert not stop.wait(0)
    stop.set()
    for thread in threads:
        thread.join()
    assert answers == [True] * 4
    assert stop.wait()
