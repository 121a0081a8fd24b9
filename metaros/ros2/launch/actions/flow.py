"""Actions that hold others, wait for something, or end the launch."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from metaros.ros2.launch.entities import Action, LaunchDescription, LaunchDescriptionEntity, flatten
from metaros.ros2.launch.events import Shutdown as ShutdownEvent
from metaros.ros2.launch.substitution import SomeSubstitutionsType, perform_substitutions

__all__ = [
    "EmitEvent",
    "ForEach",
    "ForLoop",
    "GroupAction",
    "IncludeLaunchDescription",
    "LogError",
    "LogInfo",
    "LogWarning",
    "OpaqueCoroutine",
    "OpaqueFunction",
    "RegisterEventHandler",
    "Shutdown",
    "ShutdownAction",
    "TimerAction",
    "UnregisterEventHandler",
]


class _Call(LaunchDescriptionEntity):
    """A step of our own between entities."""

    def __init__(self, call: Callable[[Any], Any]) -> None:
        self._call = call

    def visit(self, context: Any) -> list[LaunchDescriptionEntity] | None:
        return flatten(self._call(context))


class GroupAction(Action):
    """Entities under one condition. With `scoped` what they set ends with them; without `forwarding` they know the
    configurations `launch_configurations` alone."""

    def __init__(
        self,
        actions: Iterable[LaunchDescriptionEntity],
        *,
        scoped: bool = True,
        forwarding: bool = True,
        launch_configurations: Mapping[Any, SomeSubstitutionsType] | None = None,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._actions = list(actions)
        self._scoped, self._forwarding = scoped, forwarding
        self._configurations = dict(launch_configurations or {})

    def describe_sub_entities(self) -> list[LaunchDescriptionEntity]:
        """What it holds."""
        return self._actions

    def get_sub_entities(self) -> list[LaunchDescriptionEntity]:
        """What it holds."""
        return self._actions

    def execute(self, context: Any) -> list[LaunchDescriptionEntity]:
        """They come next."""
        kept = {
            perform_substitutions(context, name): perform_substitutions(context, value)
            for name, value in self._configurations.items()
        }
        if not self._scoped:
            context.launch_configurations.update(kept)
            return self._actions
        begin = _Call(lambda context: context.push(forwarding=self._forwarding, keep=kept))
        return [begin, *self._actions, _Call(lambda context: context.pop())]


class IncludeLaunchDescription(Action):
    """Another launch file, with arguments."""

    def __init__(
        self,
        launch_description_source: Any,
        *,
        launch_arguments: Iterable[tuple[SomeSubstitutionsType, SomeSubstitutionsType]]
        | Mapping[Any, Any]
        | None = None,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        from metaros.ros2.launch.launch_description_sources import as_source

        self.launch_description_source = as_source(launch_description_source)
        pairs = launch_arguments.items() if isinstance(launch_arguments, Mapping) else launch_arguments
        self.launch_arguments = tuple(pairs or ())

    def describe_sub_entities(self) -> list[LaunchDescriptionEntity]:
        """What the file describes, if it can be told without a launch."""
        found = self.launch_description_source.try_get_launch_description_without_context()
        return [] if found is None else [found]

    def execute(self, context: Any) -> list[LaunchDescriptionEntity]:
        """Its entities, with `locals` that say which file they are of; the arguments stay set, as in ROS 2."""
        for name, value in self.launch_arguments:
            context.launch_configurations[perform_substitutions(context, name)] = perform_substitutions(context, value)
        names = ("current_launch_file_path", "current_launch_file_directory")
        before = {name: getattr(context.locals, name, None) for name in names}
        description: LaunchDescription = self.launch_description_source.get_launch_description(context)
        within = {name: getattr(context.locals, name, None) for name in names}

        def place(found: Mapping[str, Any]) -> _Call:
            return _Call(lambda context: vars(context.locals).update(found))

        return [place(within), description, place(before)]


class OpaqueFunction(Action):
    """A function of the launch file: `function(context, *args, **kwargs)`, which may return entities."""

    def __init__(
        self,
        *,
        function: Callable[..., Any],
        args: Iterable[Any] | None = None,
        kwargs: Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._function, self._args, self._kwargs = function, tuple(args or ()), dict(kwargs or {})

    def execute(self, context: Any) -> list[LaunchDescriptionEntity] | None:
        """What it returns comes next."""
        return flatten(self._function(context, *self._args, **self._kwargs))


class OpaqueCoroutine(Action):
    """A coroutine of the launch file: `coroutine(context, …)`, or without the context."""

    def __init__(
        self,
        *,
        coroutine: Callable[..., Any],
        args: Iterable[Any] | None = None,
        kwargs: Mapping[str, Any] | None = None,
        ignore_context: bool = False,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._coroutine, self._args, self._kwargs = coroutine, tuple(args or ()), dict(kwargs or {})
        self._ignore_context = ignore_context

    def execute(self, context: Any) -> None:
        """Run it beside the rest."""
        args = self._args if self._ignore_context else (context, *self._args)
        context.runner.run_beside(self, self._coroutine(*args, **self._kwargs))


class ForEach(Action):
    """`function(**values)` for each of `a:1,b:2;a:3,b:4`."""

    def __init__(self, input_values: SomeSubstitutionsType, *, function: Callable[..., Any], **options: Any) -> None:
        super().__init__(**options)
        self._values, self._function = input_values, function

    def execute(self, context: Any) -> list[LaunchDescriptionEntity]:
        """What it returns for each comes next."""
        import yaml

        found: list[LaunchDescriptionEntity] = []
        wanted = inspect.signature(self._function).parameters
        for row in perform_substitutions(context, self._values).strip(";").split(";"):
            values = yaml.safe_load("{" + row.replace(":", ": ") + "}") or {}
            found += flatten(self._function(**{name: values[name] for name in wanted if name in values}))
        return found


class ForLoop(Action):
    """`function(i)` for i from 0 to the length."""

    def __init__(
        self, length: SomeSubstitutionsType, *, function: Callable[[int], Any], name: str | None = None, **options: Any
    ) -> None:
        super().__init__(**options)
        self._length, self._function = length, function

    def execute(self, context: Any) -> list[LaunchDescriptionEntity]:
        """What it returns for each comes next."""
        count = int(perform_substitutions(context, self._length))
        return [entity for number in range(count) for entity in flatten(self._function(number))]


class TimerAction(Action):
    """Actions after a time, in seconds."""

    def __init__(
        self, *, period: float | SomeSubstitutionsType, actions: Sequence[LaunchDescriptionEntity], **options: Any
    ) -> None:
        options.pop("cancel_on_shutdown", None)  # they end with the launch in any case
        super().__init__(**options)
        self._period, self.actions = period, list(actions)
        self._cancelled = False

    def cancel(self) -> None:
        """Not any more."""
        self._cancelled = True

    def describe_sub_entities(self) -> list[LaunchDescriptionEntity]:
        """What comes then."""
        return self.actions

    def execute(self, context: Any) -> None:
        """Wait beside the rest."""
        period = self._period
        period_s = float(period) if isinstance(period, (int, float)) else float(perform_substitutions(context, period))
        context.runner.after(self, period_s, lambda: [] if self._cancelled else self.actions)


class RegisterEventHandler(Action):
    """From here on an event handler is asked."""

    def __init__(self, event_handler: Any, **options: Any) -> None:
        super().__init__(**options)
        self.event_handler = event_handler

    def execute(self, context: Any) -> None:
        """Register it."""
        context.register_event_handler(self.event_handler)


class UnregisterEventHandler(RegisterEventHandler):
    """From here on it is asked no more."""

    def execute(self, context: Any) -> None:
        """Forget it."""
        context.unregister_event_handler(self.event_handler)


class EmitEvent(Action):
    """Make an event happen."""

    def __init__(self, *, event: Any, **options: Any) -> None:
        super().__init__(**options)
        self.event = event

    def execute(self, context: Any) -> None:
        """Tell it."""
        context.emit_event_sync(self.event)


class Shutdown(Action):
    """End the launch, with a reason. As `on_exit=Shutdown()` it ends when that process does."""

    def __init__(self, *, reason: SomeSubstitutionsType = "reason not given", **options: Any) -> None:
        super().__init__(**options)
        self._reason = reason

    def execute(self, context: Any) -> None:
        """Ask for it."""
        context.emit_event_sync(ShutdownEvent(reason=perform_substitutions(context, self._reason)))


ShutdownAction = Shutdown


class LogInfo(Action):
    """Say a text."""

    level = "INFO"

    def __init__(self, *, msg: SomeSubstitutionsType, **options: Any) -> None:
        super().__init__(**options)
        self.msg = msg

    def execute(self, context: Any) -> None:
        """Say it."""
        context.runner.say(self.level, "launch.user", perform_substitutions(context, self.msg))


class LogWarning(LogInfo):
    """Say a warning."""

    level = "WARNING"


class LogError(LogInfo):
    """Say an error."""

    level = "ERROR"
