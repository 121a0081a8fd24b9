"""`rclpy.task`: results to come, and functions and coroutines that an executor runs.

A coroutine that awaits a future sleeps until that is done: then its task asks its executor to be run again. One that
awaits anything else and yields, such as `asyncio.sleep(0)`, is run again at once.
"""

from __future__ import annotations

import inspect
import sys
import threading
import warnings
import weakref
from collections.abc import Callable, Coroutine, Generator, Iterable, Mapping
from typing import Any, Generic, Protocol, TypeVar

__all__ = ["Future", "Task", "TaskRunner"]

T = TypeVar("T")


class TaskRunner(Protocol):
    """What a future needs of an executor."""

    def create_task(self, callback: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        """Run it in its turn."""


class Waiter(Protocol):
    """Who waits for a future."""

    def _wake_up(self) -> None:
        """It is over."""


class _Driver(threading.local):
    """Which task this thread runs, so that a future knows who awaits it."""

    task: Task[Any] | None = None


_driver = _Driver()


def _in_asyncio() -> bool:
    """Whether an event loop of asyncio runs on this thread: then it is the loop that drives who awaits."""
    module = sys.modules.get("asyncio.events")
    return module is not None and module._get_running_loop() is not None


class Future(Generic[T]):
    """A result that is set later, from any thread. `await` it in callbacks of an executor.

    Done callbacks run on `executor`, or on the thread that sets the result where there is none.
    """

    def __init__(self, *, executor: TaskRunner | None = None) -> None:
        self._done = False
        self._cancelled = False
        self._result: T | None = None
        self._exception: BaseException | None = None
        self._exception_fetched = False
        self._callbacks: list[Callable[[Any], object]] = []
        self._waiters: list[Waiter] = []  # tasks that sleep until it is over, executors that spin until then
        self._lock = threading.Lock()
        self._executor: weakref.ref[Any] | None = None
        self._set_executor(executor)

    def __del__(self) -> None:
        if self._exception is not None and not self._exception_fetched:
            print(f"The following exception was never retrieved: {self._exception}", file=sys.stderr)

    def __await__(self) -> Generator[None, None, T | None]:
        while not self._over():
            task = _driver.task
            if task is not None and not _in_asyncio():
                task._sleeps_for = self
            yield
        return self.result()

    def _over(self) -> bool:
        return self._done or self._cancelled

    # -- asked -----------------------------------------------------------------------------------------------------

    def done(self) -> bool:
        """Whether it has a result or an exception; a cancelled one has neither."""
        return self._done

    def cancelled(self) -> bool:
        """Whether it was cancelled."""
        return self._cancelled

    def result(self) -> T | None:
        """The result, None where there is none yet; raises the exception where there is one."""
        exception = self.exception()
        if exception is not None:
            raise exception
        return self._result

    def exception(self) -> BaseException | None:
        """The exception, or None."""
        self._exception_fetched = True
        return self._exception

    # -- told ------------------------------------------------------------------------------------------------------

    def set_result(self, result: T) -> None:
        """This is the result."""
        with self._lock:
            self._result = result
            self._done = True
            self._cancelled = False
        self._schedule_or_invoke_done_callbacks()

    def set_exception(self, exception: BaseException) -> None:
        """It failed with this: `result()` raises it."""
        with self._lock:
            self._exception = exception
            self._exception_fetched = False
            self._done = True
            self._cancelled = False
        self._schedule_or_invoke_done_callbacks()

    def cancel(self) -> None:
        """Nobody wants the result any more; does nothing where it is done."""
        with self._lock:
            if not self._done:
                self._cancelled = True
        self._schedule_or_invoke_done_callbacks()

    def add_done_callback(self, callback: Callable[[Any], object]) -> None:
        """Call `callback(future)` when it is done or cancelled: on its executor, else at once.

        What the callback raises comes out here where it is called here, and is a warning where it is called later.
        """
        with self._lock:
            if not self._done:
                self._callbacks.append(callback)
                return
            executor = self._living_executor()
        if executor is None:
            callback(self)
        else:
            executor.create_task(callback, self)

    def remove_done_callback(self, callback: Callable[[Any], object]) -> bool:
        """The reverse, where it was not called yet: whether it was there."""
        with self._lock:
            if callback in self._callbacks:
                self._callbacks.remove(callback)
                return True
        return False

    def _schedule_or_invoke_done_callbacks(self) -> None:
        with self._lock:
            executor = self._living_executor()
            callbacks, self._callbacks = self._callbacks, []
            waiters, self._waiters = self._waiters, []
        for waiter in waiters:
            waiter._wake_up()
        for callback in callbacks:
            if executor is not None:
                executor.create_task(callback, self)
                continue
            try:
                callback(self)
            except Exception as error:
                warnings.warn(f"Unhandled exception in done callback: {error}", stacklevel=2)

    def _add_waiter(self, waiter: Waiter) -> bool:
        """Wake it when this is over; False where it is already."""
        with self._lock:
            if self._over():
                return False
            if waiter not in self._waiters:
                self._waiters.append(waiter)
            return True

    # -- its executor ----------------------------------------------------------------------------------------------

    def _living_executor(self) -> TaskRunner | None:
        runner: TaskRunner | None = None if self._executor is None else self._executor()
        return runner

    def _set_executor(self, executor: TaskRunner | None) -> None:
        """Run done callbacks there; it is not kept alive."""
        with self._lock:
            self._executor = None if executor is None else weakref.ref(executor)


class Task(Future[T]):
    """A function or coroutine function with its arguments, or a coroutine: calling the task runs it, or goes on.

    Executors make them, by `create_task`. What it returns or raises is the result.
    """

    def __init__(
        self,
        handler: Callable[..., Any] | Coroutine[Any, Any, T],
        args: Iterable[Any] | None = None,
        kwargs: Mapping[str, Any] | None = None,
        executor: TaskRunner | None = None,
    ) -> None:
        super().__init__(executor=executor)
        self._handler: Callable[..., Any] | Coroutine[Any, Any, T] | None = handler
        self._args = () if args is None else tuple(args)
        self._kwargs = {} if kwargs is None else dict(kwargs)
        self._coroutine: Coroutine[Any, Any, T] | None = handler if isinstance(handler, Coroutine) else None
        self._executing = False
        self._sleeps_for: Future[Any] | None = None
        self._task_lock = threading.Lock()
        self.polls = 0  # how often in a row it yielded without saying what it waits for

    def executing(self) -> bool:
        """Whether it runs at this moment."""
        return self._executing

    def __call__(self) -> None:
        """Run it, or go on, up to its end or to what it awaits; nothing where it is over or runs already."""
        if self._over() or not self._task_lock.acquire(blocking=False):
            return
        try:
            if self._over():
                return
            self._executing = True
            try:
                finished = self._step()
            finally:
                self._executing = False
        finally:
            self._task_lock.release()
        if not finished:
            self._sleep()

    def _step(self) -> bool:
        """Whether that was the end."""
        outer, _driver.task, self._sleeps_for = _driver.task, self, None
        try:
            coroutine = self._coroutine
            if coroutine is None:
                handler: Any = self._handler
                outcome = handler(*self._args, **self._kwargs)
                if not inspect.iscoroutinefunction(handler):
                    self._finish(outcome)
                    return True
                coroutine = self._coroutine = outcome
            try:
                coroutine.send(None)
            except StopIteration as stop:
                self._finish(stop.value)
                return True
        except Exception as error:
            self._complete_task()
            self.set_exception(error)
            return True
        finally:
            _driver.task = outer
        return False

    def _finish(self, result: T) -> None:
        self._complete_task()
        self.set_result(result)

    def _sleep(self) -> None:
        """Until what it awaits is over, or until the executor's next round where it only yielded."""
        future, self._sleeps_for = self._sleeps_for, None
        if future is not None and future._add_waiter(self):
            self.polls = 0
            return
        self.polls = 0 if future is not None else self.polls + 1
        self._wake_up()

    def _wake_up(self) -> None:
        """Have the executor go on with it."""
        call_later = getattr(self._living_executor(), "_call_task_in_next_spin", None)
        if call_later is not None:
            call_later(self)

    def cancel(self) -> None:
        """Run it no more; the coroutine ends where it stands, unless that is just running."""
        super().cancel()
        if not self._cancelled:
            return
        if self._task_lock.acquire(blocking=False):
            try:
                self._complete_task()
            finally:
                self._task_lock.release()
        self.polls = 0
        self._wake_up()  # so that its executor forgets it

    def _complete_task(self) -> None:
        """It is over: nothing is kept."""
        coroutine, self._coroutine = self._coroutine, None
        self._handler, self._args, self._kwargs = None, (), {}
        if coroutine is not None:
            coroutine.close()
