"""Futures and tasks by themselves, without an executor that spins."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from metaros.ros2.rclpy.execution.task import Future, Task


class Recorder:
    """An executor that notes what it should run."""

    def __init__(self) -> None:
        self.tasks: list[tuple[Any, ...]] = []
        self.again: list[Task[Any]] = []

    def create_task(self, callback: Callable[..., Any], *args: Any, **kwargs: Any) -> None:
        """Note it."""
        self.tasks.append((callback, *args))

    def _call_task_in_next_spin(self, task: Task[Any]) -> None:
        self.again.append(task)


def _fail(future: Future[Any]) -> None:
    future.set_exception(KeyError("lost"))


_ENDS: tuple[Callable[[Future[Any]], object], ...] = (lambda future: future.set_result(5), _fail, Future.cancel)


def test_a_future_has_a_result_an_exception_or_is_cancelled() -> None:
    future = Future[int]()
    assert (future.done(), future.cancelled(), future.result(), future.exception()) == (False, False, None, None)
    future.cancel()
    assert (future.done(), future.cancelled()) == (False, True)
    future.set_result(5)
    assert (future.done(), future.cancelled(), future.result()) == (True, False, 5)
    future.cancel()
    assert not future.cancelled()
    _fail(future)
    with pytest.raises(KeyError, match="lost"):
        future.result()
    assert isinstance(future.exception(), KeyError)


def test_done_callbacks_run_at_once_without_an_executor() -> None:
    for end in _ENDS:
        future, called = Future[int](), list[Future[int]]()
        future.add_done_callback(called.append)
        end(future)
        assert called == [future]
        future.exception()
    future.set_result(1)
    future.add_done_callback(called.append)
    assert called == [future, future]


def test_done_callbacks_go_to_the_executor_and_one_that_fails_is_a_warning() -> None:
    recorder = Recorder()
    for end in _ENDS:
        future = Future[int](executor=recorder)
        future.add_done_callback(print)
        end(future)
        future.add_done_callback(repr)
        after = [] if future.cancelled() else [(repr, future)]
        assert recorder.tasks == [(print, future), *after]
        recorder.tasks.clear()
        future.exception()
    future = Future[int]()
    future.add_done_callback(lambda _: 1 / 0)
    with pytest.warns(UserWarning, match="done callback: division by zero"):
        future.set_result(1)
    with pytest.raises(ZeroDivisionError):
        future.add_done_callback(lambda _: 1 / 0)


def test_a_callback_may_be_taken_back() -> None:
    future, called = Future[int](), list[Any]()
    future.add_done_callback(called.append)
    assert future.remove_done_callback(called.append)
    assert not future.remove_done_callback(called.append)
    future.set_result(1)
    assert called == []


def test_an_exception_that_nobody_asked_for_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    for asked in (False, True):
        future = Future[int]()
        _fail(future)
        if asked:
            future.exception()
        del future
        gc.collect()
        assert capsys.readouterr().err.count("never retrieved: 'lost'") == (not asked)


def test_a_coroutine_awaits_a_future_step_by_step() -> None:
    async def waits(future: Future[int]) -> int | None:
        return await future

    for end in _ENDS:
        future = Future[int]()
        coroutine = waits(future)
        coroutine.send(None)
        coroutine.send(None)
        end(future)
        with pytest.raises((StopIteration, KeyError)) as stopped:
            coroutine.send(None)
        if future.done() and future.exception() is None:
            assert stopped.value.value == 5


def test_asyncio_may_await_a_future() -> None:
    future = Future[int]()

    async def main() -> int | None:
        asyncio.get_running_loop().call_soon(future.set_result, 7)
        return await future

    task = Task[int](lambda: asyncio.run(main()))  # a task's own thread runs a loop: the loop drives
    task()
    assert task.result() == 7


def test_what_a_loop_within_a_task_awaited_is_not_what_the_task_awaits() -> None:
    recorder = Recorder()

    async def within() -> None:
        with suppress(TimeoutError):
            async with asyncio.timeout(0):
                await Future[None]()

    async def outer() -> None:
        asyncio.run(within())
        await asyncio.sleep(0)

    task = Task[None](outer, executor=recorder)
    task()
    assert recorder.again == [task]
    task()
    assert task.done()


def test_a_task_runs_what_it_was_given_once() -> None:
    calls = list[Any]()

    def plain(*args: Any, **kwargs: Any) -> str:
        calls.append((args, kwargs))
        return "plain"

    async def later(*args: Any, **kwargs: Any) -> str:
        calls.append((args, kwargs))
        await asyncio.sleep(0)
        return "later"

    for handler, steps in ((plain, 1), (later, 2), (lambda *args, **kwargs: plain(*args, **kwargs), 1)):
        task = Task[str](handler, (1,), {"two": 2})
        assert not task.done()
        for _ in range(steps):
            assert not task.done()
            task()
        assert task.done()
        assert not task.executing()
        assert task.result() == ("later" if steps == 2 else "plain")
        task()
    assert calls == [((1,), {"two": 2})] * 3


def test_what_a_task_raises_is_its_exception() -> None:
    async def fails() -> None:
        raise KeyError("lost")

    for handler in (lambda: {}["lost"], fails, fails()):
        task = Task[None](handler)
        task()
        assert task.done()
        with pytest.raises(KeyError, match="lost"):
            task.result()


def test_a_task_that_awaits_a_future_asks_to_be_run_when_that_is_over() -> None:
    recorder = Recorder()
    future = Future[int]()

    async def waits() -> int | None:
        return await future

    for end in (Future.cancel, lambda future: future.set_result(5)):
        task = Task[int](waits, executor=recorder)
        task()
        assert recorder.again == []
        end(future)
        assert recorder.again == [task]
        recorder.again.clear()
        task()
        assert task.done()
        future._cancelled = False


def test_one_that_only_yields_asks_at_once_and_counts_that() -> None:
    recorder = Recorder()

    async def polls() -> None:
        for _ in range(3):
            await asyncio.sleep(0)

    task = Task[None](polls, executor=recorder)
    for count in (1, 2, 3):
        task()
        assert (recorder.again, task.polls) == ([task] * count, count)
    task()
    assert task.done()


def test_a_cancelled_task_ends_where_it_stands() -> None:
    ended = list[str]()

    async def waits() -> None:
        try:
            await Future[None]()
        finally:
            ended.append("ended")

    task = Task[None](waits)
    task()
    task.cancel()
    assert (ended, task.cancelled(), task.done()) == (["ended"], True, False)
    task()
    assert not task.done()
    unused = Task[None](waits)
    unused.cancel()  # nothing began, and nothing is left to warn of
    assert unused.cancelled()
