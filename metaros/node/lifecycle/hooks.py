"""The callbacks of a lifecycle node: methods that a subclass overrides, or functions that a decorator names.

They may be plain or `async def`. What awaits is written as a generator that yields awaitables: `drive` runs it through
where nothing has to be awaited, and hands back a coroutine where something has.
"""

from __future__ import annotations

import inspect
import logging
from collections.abc import Awaitable, Callable, Coroutine, Generator
from typing import Any, TypeVar

from metaros.errors import UsageError
from metaros.node.info import takes
from metaros.node.lifecycle.state_machine import Result

__all__ = ["HOOKS", "Hook", "HookSlot", "Steps", "ask", "drive", "is_async", "run_plain"]

T = TypeVar("T")
Steps = Generator[Awaitable[Any], Any, T]
_log = logging.getLogger("metaros.node")

HOOKS = (
    "on_configure",
    "on_cleanup",
    "on_activate",
    "on_deactivate",
    "on_shutdown",
    "on_error",
    "on_degrade",
    "on_recover",
)


class HookSlot:
    """One node's own callback of a name, which `@node.on_configure` fills in; called otherwise it does nothing."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self.callback: Callable[..., Any] | None = None

    def __call__(self, callback: Any = None) -> Any:
        if callable(callback):
            self.callback = callback
            if inspect.iscoroutinefunction(callback):
                self._node.ingress.async_work = True
            return callback
        return None


class Hook:
    """A name that a subclass overrides with a method; else each node has a slot of it."""

    def __set_name__(self, owner: type[Any], name: str) -> None:
        self._name = name

    def __get__(self, node: Any, owner: type[Any]) -> Any:
        return self if node is None else node.hook_slots[self._name]


def _callback(node: Any, name: str) -> Callable[..., Any] | None:
    """What a node has for a hook."""
    found: Any = getattr(node, name, None)
    return found.callback if isinstance(found, HookSlot) else found


def is_async(node: Any, name: str) -> bool:
    """Whether a hook has to be awaited."""
    return inspect.iscoroutinefunction(_callback(node, name))


def ask(node: Any, name: str, *arguments: Any, default: Result = Result.SUCCESS) -> Steps[Result]:
    """Call a hook with as many arguments as it takes; an exception is logged and is an error."""
    callback = _callback(node, name)
    if callback is None:
        return default
    try:
        answer = callback(*arguments[: takes(callback, *range(len(arguments), -1, -1))])
        if inspect.isawaitable(answer):
            answer = yield answer
        return _result(name, answer)
    except Exception:
        _log.exception("%s of %s failed", name, node.full_name)
        return Result.ERROR


def _result(name: str, answer: Any) -> Result:
    if isinstance(answer, Result):
        return answer
    if answer is None or isinstance(answer, bool):
        return Result.FAILURE if answer is False else Result.SUCCESS
    raise UsageError(f"{name} returns True or nothing for success, False for failure, or a Result, not {answer!r}")


def drive(steps: Steps[T]) -> T | Coroutine[Any, Any, T]:
    """The result, or a coroutine of it if a hook is an `async def`."""
    try:
        first = next(steps)
    except StopIteration as done:
        result: T = done.value
        return result
    return _await(steps, first)


def run_plain(steps: Steps[T]) -> T:
    """The result; a hook that would have to be awaited fails, since nobody here can wait for it."""
    try:
        awaitable = next(steps)
        while True:
            if inspect.iscoroutine(awaitable):
                awaitable.close()
            awaitable = steps.throw(UsageError("an async def cannot be awaited here"))
    except StopIteration as done:
        result: T = done.value
        return result


async def _await(steps: Steps[T], awaitable: Awaitable[Any]) -> T:
    while True:
        try:
            try:
                answer = await awaitable
            except Exception as error:
                awaitable = steps.throw(error)
            else:
                awaitable = steps.send(answer)
        except StopIteration as done:
            result: T = done.value
            return result
