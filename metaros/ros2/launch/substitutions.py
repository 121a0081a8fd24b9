"""The substitutions that launch files use."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from metaros.ros2.launch.conditions import evaluate_condition_expression
from metaros.ros2.launch.substitution import (
    SomeSubstitutionsType,
    Substitution,
    SubstitutionFailure,
    TextSubstitution,
    perform_substitutions,
)
from metaros.ros2.programs.stand_ins import ros2_file

__all__ = [
    "AllSubstitution",
    "AndSubstitution",
    "AnonName",
    "AnySubstitution",
    "Command",
    "EnvironmentVariable",
    "EqualsSubstitution",
    "FileContent",
    "FindExecutable",
    "IfElseSubstitution",
    "LaunchConfiguration",
    "LaunchLogDir",
    "LocalSubstitution",
    "NotEqualsSubstitution",
    "NotSubstitution",
    "OrSubstitution",
    "PathJoinSubstitution",
    "PathSubstitution",
    "PythonExpression",
    "SubstitutionFailure",
    "TextSubstitution",
    "ThisLaunchFile",
    "ThisLaunchFileDir",
]

_COMMAND_S: Final = 60.0


class LaunchConfiguration(Substitution):
    """The text of a configuration: a declared argument, or what SetLaunchConfiguration has set."""

    def __init__(self, variable_name: SomeSubstitutionsType, *, default: Any = None) -> None:
        self.variable_name = variable_name
        self.default = default

    def perform(self, context: Any) -> str:
        """The text, else the default."""
        name = perform_substitutions(context, self.variable_name)
        if name in context.launch_configurations:
            return str(context.launch_configurations[name])
        if self.default is None:
            raise SubstitutionFailure(f"there is no launch configuration {name!r}")
        parts = self.default if isinstance(self.default, (list, tuple)) else [self.default]
        return "".join(part.perform(context) if isinstance(part, Substitution) else str(part) for part in parts)

    def describe(self) -> str:
        """`LaunchConfiguration('name')`."""
        return f"LaunchConfiguration({self.variable_name!r})"


class EnvironmentVariable(Substitution):
    """The text of an environment variable."""

    def __init__(self, name: SomeSubstitutionsType, *, default_value: SomeSubstitutionsType | None = None) -> None:
        self._name, self._default = name, default_value

    def perform(self, context: Any) -> str:
        """The text, else the default."""
        name = perform_substitutions(context, self._name)
        found = context.environment.get(name)
        if found is not None:
            return str(found)
        if self._default is None:
            raise SubstitutionFailure(f"the environment variable {name!r} is not set")
        return perform_substitutions(context, self._default)


class PathJoinSubstitution(Substitution):
    """Parts of a path, joined. `PathSubstitution(a) / b` makes one."""

    def __init__(self, substitutions: Sequence[SomeSubstitutionsType]) -> None:
        self.substitutions = list(substitutions)

    def __truediv__(self, part: SomeSubstitutionsType) -> PathJoinSubstitution:
        return PathJoinSubstitution([*self.substitutions, part])

    def perform(self, context: Any) -> str:
        """The path."""
        return os.path.join(*(perform_substitutions(context, part) for part in self.substitutions))


class PathSubstitution(PathJoinSubstitution):
    """A path to which parts may be added with `/`."""

    def __init__(self, path: SomeSubstitutionsType) -> None:
        super().__init__([path])


class FindExecutable(Substitution):
    """Where a program is on the PATH; `ros2` is this library's where there is no other."""

    def __init__(self, *, name: SomeSubstitutionsType) -> None:
        self.name = name

    def perform(self, context: Any) -> str:
        """Its path."""
        name = perform_substitutions(context, self.name)
        found = sys.executable if name in ("python3", "python") else shutil.which(name)
        if found is None and name == "ros2":
            found = ros2_file()
        if found is None:
            raise SubstitutionFailure(f"there is no program {name!r} on the PATH")
        return found


class Command(Substitution):
    """What a command prints."""

    def __init__(self, command: SomeSubstitutionsType, *, on_stderr: SomeSubstitutionsType = "fail") -> None:
        self._command, self._on_stderr = command, on_stderr

    def perform(self, context: Any) -> str:
        """Its output, at most a minute later; fails where it fails, or where it complains (`on_stderr`)."""
        text = perform_substitutions(context, self._command)
        done = subprocess.run(shlex.split(text), capture_output=True, text=True, timeout=_COMMAND_S, check=False)
        complains = done.stderr and perform_substitutions(context, self._on_stderr) == "fail"
        if done.returncode or complains:
            raise SubstitutionFailure(f"{text!r} ended with {done.returncode}: {done.stderr.strip()}")
        return done.stdout


class PythonExpression(Substitution):
    """What Python makes of an expression, as text."""

    def __init__(self, expression: SomeSubstitutionsType, python_modules: SomeSubstitutionsType = ("math",)) -> None:
        self._expression = expression
        names = [python_modules] if isinstance(python_modules, (str, Substitution)) else python_modules
        self._modules = list(names)  # type: ignore[arg-type]

    def perform(self, context: Any) -> str:
        """The result of the expression, a launch file's own code as the file itself is."""
        scope: dict[str, Any] = {}
        for name in (perform_substitutions(context, module) for module in self._modules):
            module = __import__(name)
            scope |= {name: module, **{key: value for key, value in vars(module).items() if name == "math"}}
        return str(eval(perform_substitutions(context, self._expression), scope))


class ThisLaunchFile(Substitution):
    """The file that is being read."""

    def perform(self, context: Any) -> str:
        """Its path."""
        return str(_local(context, "current_launch_file_path"))


class ThisLaunchFileDir(Substitution):
    """Its folder."""

    def perform(self, context: Any) -> str:
        """The folder's path."""
        return str(_local(context, "current_launch_file_directory"))


class LaunchLogDir(Substitution):
    """Where this launch's logs are."""

    def perform(self, context: Any) -> str:
        """The folder's path."""
        return str(context.runner.log_dir)


class LocalSubstitution(Substitution):
    """An attribute of the context's `locals`, such as `event.returncode` in an event handler."""

    def __init__(self, expression: str, description: str | None = None) -> None:
        self._expression = expression

    def perform(self, context: Any) -> str:
        """The attribute as text."""
        found: Any = context.locals
        for part in self._expression.split("."):
            found = getattr(found, part, None)
            if found is None:
                raise SubstitutionFailure(f"there is no {self._expression!r} here")
        return str(found)


class FileContent(Substitution):
    """What a file holds."""

    def __init__(self, path: SomeSubstitutionsType) -> None:
        self._path = path

    def perform(self, context: Any) -> str:
        """Its text."""
        path = perform_substitutions(context, self._path)
        try:
            return Path(path).read_text(encoding="utf-8")
        except OSError as error:
            raise SubstitutionFailure(f"cannot read {path}: {error.strerror}") from None


class AnonName(Substitution):
    """A name that no other launch uses; the same for the same text in this one."""

    def __init__(self, name: SomeSubstitutionsType) -> None:
        self._name = name

    def perform(self, context: Any) -> str:
        """The name, and numbers behind it."""
        name = perform_substitutions(context, self._name)
        key = f"anon{name}"
        return str(context.launch_configurations.setdefault(key, f"{name}_{os.getpid()}_{id(context) & 0xFFFF}"))


class _Boolean(Substitution):
    """`true` or `false` of other texts."""

    def __init__(self, *parts: SomeSubstitutionsType, decide: Callable[[list[bool]], bool] = all) -> None:
        self._parts, self._decide = parts, decide

    def perform(self, context: Any) -> str:
        """As text."""
        return str(self._decide([evaluate_condition_expression(context, part) for part in self._parts])).lower()


class NotSubstitution(_Boolean):
    """Whether the text is false."""

    def __init__(self, value: SomeSubstitutionsType) -> None:
        super().__init__(value, decide=lambda found: not found[0])


class AndSubstitution(_Boolean):
    """Whether both are true."""

    def __init__(self, left: SomeSubstitutionsType, right: SomeSubstitutionsType) -> None:
        super().__init__(left, right)


class OrSubstitution(_Boolean):
    """Whether one of both is true."""

    def __init__(self, left: SomeSubstitutionsType, right: SomeSubstitutionsType) -> None:
        super().__init__(left, right, decide=any)


class AnySubstitution(_Boolean):
    """Whether one of them is true."""

    def __init__(self, *args: SomeSubstitutionsType) -> None:
        super().__init__(*args, decide=any)


class AllSubstitution(_Boolean):
    """Whether all of them are true."""


class EqualsSubstitution(Substitution):
    """Whether two texts are the same; numbers and truth values by what they mean."""

    def __init__(self, left: Any, right: Any) -> None:
        self._sides = left, right

    def perform(self, context: Any) -> str:
        """`true` or `false`."""
        left, right = (_meant(context, side) for side in self._sides)
        return str(left == right).lower()


class NotEqualsSubstitution(EqualsSubstitution):
    """Whether they differ."""

    def perform(self, context: Any) -> str:
        """`true` or `false`."""
        return "false" if super().perform(context) == "true" else "true"


class IfElseSubstitution(Substitution):
    """One text or the other."""

    def __init__(
        self,
        condition: SomeSubstitutionsType,
        if_value: SomeSubstitutionsType = "",
        else_value: SomeSubstitutionsType = "",
    ) -> None:
        self._condition, self._values = condition, (else_value, if_value)

    def perform(self, context: Any) -> str:
        """The first where the condition holds."""
        return perform_substitutions(context, self._values[evaluate_condition_expression(context, self._condition)])


def _local(context: Any, name: str) -> Any:
    found = getattr(context.locals, name, None)
    if found is None:
        raise SubstitutionFailure("this is in no launch file")
    return found


def _meant(context: Any, side: Any) -> Any:
    text = str(side) if isinstance(side, (bool, int, float)) else perform_substitutions(context, side)
    lowered = text.strip().lower()
    if lowered in ("true", "false"):
        return lowered == "true"
    try:
        return float(text)
    except ValueError:
        return text
