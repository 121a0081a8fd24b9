"""`rclpy.guard_condition`: run a callback on the executor because somebody says so, from any thread."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from metaros.executor import CallbackGroup
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.destroyable import Destroyable
from metaros.ros2.rclpy.core.utilities import get_default_context

__all__ = ["GuardCondition", "GuardHandle"]


class GuardHandle(Destroyable):
    """Whether it was triggered since somebody last looked."""

    def __init__(self, wake: Callable[[], object]) -> None:
        self.triggered = False
        self._wake = wake

    def trigger_guard_condition(self) -> None:
        """It is; who waits looks."""
        self.triggered = True
        self._wake()


class GuardCondition:
    """`trigger()` makes the executor that spins its node run `callback`, once however often it was triggered."""

    def __init__(
        self,
        callback: Callable[[], Any] | None,
        callback_group: CallbackGroup | None,
        context: Context | None = None,
    ) -> None:
        self._context = get_default_context() if context is None else context
        self._handle = GuardHandle(self._context.wake)
        self.callback = callback
        self.callback_group = callback_group

    def trigger(self) -> None:
        """From any thread, and from handlers of signals. InvalidHandle where it was destroyed."""
        with self._handle:
            self._handle.trigger_guard_condition()

    @property
    def handle(self) -> GuardHandle:
        """What wait sets take."""
        return self._handle

    def destroy(self) -> None:
        """End it. Programs say `node.destroy_guard_condition(guard)`, which takes it from the node as well."""
        self._handle.destroy_when_not_in_use()

    def take(self) -> Callable[[], Any] | None:
        """For executors: it is being answered now, by what is returned."""
        self._handle.triggered = False
        return self.callback

    def __enter__(self) -> GuardCondition:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()
