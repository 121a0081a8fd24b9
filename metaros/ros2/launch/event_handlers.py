"""Event handlers: what a launch does when something happens."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from metaros.ros2.launch.entities import LaunchDescriptionEntity, flatten
from metaros.ros2.launch.events import ExecutionComplete, Shutdown
from metaros.ros2.launch.events.process import ProcessExited, ProcessIO, ProcessStarted

__all__ = ["EventHandler", "OnExecutionComplete", "OnProcessExit", "OnProcessIO", "OnProcessStart", "OnShutdown"]


class EventHandler:
    """`entities` are visited for each event that `matcher(event)` takes; their `locals.event` is that event."""

    def __init__(self, *, matcher: Callable[[Any], bool], entities: Any = None, handle_once: bool = False) -> None:
        self._matcher = matcher
        self.entities = entities
        self.handle_once = handle_once

    def matches(self, event: Any) -> bool:
        """Whether the event concerns it."""
        return bool(self._matcher(event))

    def handle(self, event: Any, context: Any) -> list[LaunchDescriptionEntity]:
        """The entities that come now."""
        context.locals.event = event
        if self.handle_once:
            context.unregister_event_handler(self)
        return flatten(self.entities)


class _OnProcess(EventHandler):
    """Entities, or a function of event and context that returns some, for events of a process or of all."""

    def __init__(self, kind: type[Any], target: Any, then: Any, *, handle_once: bool = False) -> None:
        self._kind, self._then = kind, then
        super().__init__(matcher=lambda event: self._takes(event, target), handle_once=handle_once)

    def _takes(self, event: Any, target: Any) -> bool:
        if not isinstance(event, self._kind):
            return False
        if target is None or event.action is target:
            return True
        return callable(target) and bool(target(event.action))

    def handle(self, event: Any, context: Any) -> list[LaunchDescriptionEntity]:
        """What is to be done for it."""
        super().handle(event, context)
        return flatten(self._then(event, context) if callable(self._then) else self._then)


class OnProcessStart(_OnProcess):
    """When a process runs."""

    def __init__(self, *, target_action: Any = None, on_start: Any, **options: Any) -> None:
        super().__init__(ProcessStarted, target_action, on_start, **options)


class OnProcessExit(_OnProcess):
    """When a process has ended."""

    def __init__(self, *, target_action: Any = None, on_exit: Any, **options: Any) -> None:
        super().__init__(ProcessExited, target_action, on_exit, **options)


class OnExecutionComplete(_OnProcess):
    """When an action is done."""

    def __init__(self, *, target_action: Any = None, on_completion: Any, **options: Any) -> None:
        super().__init__(ExecutionComplete, target_action, on_completion, **options)


class OnProcessIO(EventHandler):
    """For each line of a process: `on_stdout(event)`. Both of its outputs come as one, so `on_stderr` gets them, too,
    where `on_stdout` is not given."""

    def __init__(
        self,
        *,
        target_action: Any = None,
        on_stdin: Callable[[Any], Any] | None = None,
        on_stdout: Callable[[Any], Any] | None = None,
        on_stderr: Callable[[Any], Any] | None = None,
        **options: Any,
    ) -> None:
        self._callback = on_stdout or on_stderr
        super().__init__(
            matcher=lambda event: isinstance(event, ProcessIO) and target_action in (None, event.action), **options
        )

    def handle(self, event: Any, context: Any) -> list[LaunchDescriptionEntity]:
        """What the callback returns."""
        super().handle(event, context)
        return flatten(self._callback(event) if self._callback is not None else None)


class OnShutdown(EventHandler):
    """When the launch ends: `on_shutdown` is entities, or a function of event and context."""

    def __init__(
        self, *, on_shutdown: Callable[[Any, Any], Any] | Iterable[Any] | LaunchDescriptionEntity, **options: Any
    ) -> None:
        self._then = on_shutdown
        super().__init__(matcher=lambda event: isinstance(event, Shutdown), **options)

    def handle(self, event: Any, context: Any) -> list[LaunchDescriptionEntity]:
        """What is to be done at the end."""
        super().handle(event, context)
        return flatten(self._then(event, context) if callable(self._then) else self._then)
