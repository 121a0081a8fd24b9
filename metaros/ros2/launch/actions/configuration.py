"""Actions on launch configurations and the environment."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

from metaros.ros2.launch.entities import Action
from metaros.ros2.launch.substitution import SomeSubstitutionsType, perform_substitutions

__all__ = [
    "AppendEnvironmentVariable",
    "DeclareLaunchArgument",
    "PopEnvironment",
    "PopLaunchConfigurations",
    "PushEnvironment",
    "PushLaunchConfigurations",
    "ResetEnvironment",
    "ResetLaunchConfigurations",
    "SetEnvironmentVariable",
    "SetLaunchConfiguration",
    "UnsetEnvironmentVariable",
    "UnsetLaunchConfiguration",
]


class DeclareLaunchArgument(Action):
    """A configuration that `name:=value` may set; without it the default counts, and without that it must be given."""

    def __init__(
        self,
        name: str,
        *,
        default_value: SomeSubstitutionsType | None = None,
        description: str | None = None,
        choices: Iterable[str] | None = None,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self.name = name
        self.default_value = default_value
        self.description = description or "no description given"
        self.choices = None if choices is None else list(choices)
        if self.choices == []:
            raise ValueError(f"the choices of the launch argument {name!r} are empty")

    def execute(self, context: Any) -> None:
        """Take the default where nothing was given; refuse what is none of the choices."""
        if self.name not in context.launch_configurations:
            if self.default_value is None:
                raise RuntimeError(f"the launch argument {self.name!r} must be given: {self.description}")
            context.launch_configurations[self.name] = perform_substitutions(context, self.default_value)
        found = context.launch_configurations[self.name]
        if self.choices is not None and found not in self.choices:
            raise RuntimeError(f"the launch argument {self.name!r} is {found!r}; it must be one of {self.choices}")


class SetLaunchConfiguration(Action):
    """Give a configuration a text."""

    def __init__(self, name: SomeSubstitutionsType, value: SomeSubstitutionsType, **options: Any) -> None:
        super().__init__(**options)
        self._name, self._value = name, value

    def execute(self, context: Any) -> None:
        """Set it, in the group that this is in."""
        name = perform_substitutions(context, self._name)
        context.launch_configurations[name] = perform_substitutions(context, self._value)


class UnsetLaunchConfiguration(Action):
    """Forget a configuration."""

    def __init__(self, name: SomeSubstitutionsType, **options: Any) -> None:
        super().__init__(**options)
        self._name = name

    def execute(self, context: Any) -> None:
        """Take it away, where it is."""
        context.launch_configurations.pop(perform_substitutions(context, self._name), None)


class ResetLaunchConfigurations(Action):
    """Forget all configurations but these."""

    def __init__(
        self, launch_configurations: Mapping[Any, SomeSubstitutionsType] | None = None, **options: Any
    ) -> None:
        super().__init__(**options)
        self._kept = dict(launch_configurations or {})

    def execute(self, context: Any) -> None:
        """Keep what was given, with its text of now."""
        kept = {
            perform_substitutions(context, name): perform_substitutions(context, value)
            for name, value in self._kept.items()
        }
        context.launch_configurations.clear()
        context.launch_configurations.update(kept)


class PushLaunchConfigurations(Action):
    """What is set from here on ends with PopLaunchConfigurations."""

    def execute(self, context: Any) -> None:
        """Begin."""
        context.push()


class PopLaunchConfigurations(Action):
    """End what PushLaunchConfigurations has begun."""

    def execute(self, context: Any) -> None:
        """End."""
        context.pop()


class PushEnvironment(Action):
    """What is set in the environment from here on ends with PopEnvironment."""

    def execute(self, context: Any) -> None:
        """Begin."""
        context.push(keep=context.launch_configurations)


class PopEnvironment(PopLaunchConfigurations):
    """End what PushEnvironment has begun."""


class ResetEnvironment(Action):
    """The environment as it was when the launch began."""

    def execute(self, context: Any) -> None:
        """Set it back."""
        os.environ.clear()
        os.environ.update(context.runner.first_environment)


class SetEnvironmentVariable(Action):
    """Set a variable for what is started from here on."""

    def __init__(self, name: SomeSubstitutionsType, value: SomeSubstitutionsType, **options: Any) -> None:
        super().__init__(**options)
        self._name, self._value = name, value

    def execute(self, context: Any) -> None:
        """Set it."""
        context.environment[perform_substitutions(context, self._name)] = perform_substitutions(context, self._value)


class UnsetEnvironmentVariable(Action):
    """Take a variable away."""

    def __init__(self, name: SomeSubstitutionsType, **options: Any) -> None:
        super().__init__(**options)
        self._name = name

    def execute(self, context: Any) -> None:
        """Take it away, where it is."""
        context.environment.pop(perform_substitutions(context, self._name), None)


class AppendEnvironmentVariable(Action):
    """Add to a variable that is a list, at its end or, with `prepend`, at its beginning."""

    def __init__(
        self,
        name: SomeSubstitutionsType,
        value: SomeSubstitutionsType,
        prepend: bool | SomeSubstitutionsType = False,
        separator: SomeSubstitutionsType = os.pathsep,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._name, self._value, self._prepend, self._separator = name, value, prepend, separator

    def execute(self, context: Any) -> None:
        """Add it."""
        name, value = perform_substitutions(context, self._name), perform_substitutions(context, self._value)
        first = self._prepend
        if not isinstance(first, bool):
            first = perform_substitutions(context, first).lower() == "true"
        parts = [part for part in (context.environment.get(name, ""), value) if part]
        separator = perform_substitutions(context, self._separator)
        context.environment[name] = separator.join(reversed(parts) if first else parts)
