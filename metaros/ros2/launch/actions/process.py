"""Actions that start processes."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterable, Mapping
from typing import Any, Final

from metaros.ros2.launch.entities import Action, LaunchDescriptionEntity, flatten
from metaros.ros2.launch.event_handlers import EventHandler, OnProcessExit
from metaros.ros2.launch.events.process import ShutdownProcess, SignalProcess
from metaros.ros2.launch.substitution import SomeSubstitutionsType, perform_substitutions
from metaros.ros2.programs.stand_ins import folder_with_ros2

__all__ = ["ExecuteLocal", "ExecuteProcess"]

_ROS2: Final = re.compile(r"(?:^|[\s;&|(])ros2(?:\s|$)")  # as a command's first word, also within a shell's line


class ExecuteProcess(Action):
    """Start a process, keep it where `respawn` is set, and end it with the launch.

    `output` is "screen", "both" or "log" (its lines go to a file alone). `on_exit` comes when it ends. Not understood,
    and said so: `emulate_tty`, `cached_output`, `respawn_max_retries`; a process has no terminal.
    """

    def __init__(
        self,
        *,
        cmd: Iterable[SomeSubstitutionsType] = (),
        name: SomeSubstitutionsType | None = None,
        prefix: SomeSubstitutionsType | None = None,
        cwd: SomeSubstitutionsType | None = None,
        env: Mapping[Any, SomeSubstitutionsType] | None = None,
        additional_env: Mapping[Any, SomeSubstitutionsType] | None = None,
        shell: bool = False,
        output: Any = "log",
        on_exit: Any = None,
        respawn: bool | SomeSubstitutionsType = False,
        respawn_delay: float | None = None,
        sigterm_timeout: SomeSubstitutionsType = "5",
        sigkill_timeout: SomeSubstitutionsType = "5",
        condition: Any = None,
        **not_understood: Any,
    ) -> None:
        super().__init__(condition=condition)
        self.cmd = list(cmd)
        self.shell = shell
        self.respawn_delay_s = respawn_delay or 0.0
        self.process_details: dict[str, Any] | None = None  # while it runs
        self.return_code: int | None = None
        self._name, self._prefix, self._cwd, self._env = name, prefix, cwd, env
        self._additional_env = dict(additional_env or {})
        self._output, self._respawn, self._on_exit = output, respawn, on_exit
        self._timeouts = sigterm_timeout, sigkill_timeout
        self._not_understood = sorted(not_understood)

    def describe(self) -> str:
        """What it starts."""
        return f"{type(self).__name__}({self.cmd!r})"

    def words(self, context: Any) -> list[str]:
        """The command, ready to be started."""
        words = [perform_substitutions(context, part) for part in self.cmd]
        if self.shell:
            return ["sh", "-c", " ".join(words)]
        prefix = perform_substitutions(context, self._prefix) if self._prefix else ""
        prefix = prefix or context.launch_configurations.get("launch-prefix", "")
        return [*shlex.split(prefix), *words]

    def called(self, context: Any) -> str:
        """What its lines are marked with, before a number: its name, else its program's."""
        if self._name is not None:
            return perform_substitutions(context, self._name)
        first = perform_substitutions(context, self.cmd[0]) if self.cmd else "process"
        return first.split()[0].rpartition("/")[2]

    def environment(self, context: Any) -> dict[str, str]:
        """Its own variables, beside those of the launch."""
        given = {**(self._env or {}), **self._additional_env}
        return {
            perform_substitutions(context, name): perform_substitutions(context, value) for name, value in given.items()
        }

    def execute(self, context: Any) -> list[LaunchDescriptionEntity] | None:
        """Start it."""
        if context.is_shutdown:
            return None
        for name in self._not_understood:
            context.runner.not_understood(f"{self.called(context)}: {name}")
        if self._on_exit is not None:
            context.register_event_handler(OnProcessExit(target_action=self, on_exit=self._on_exit))
        for handler in self._orders(context):
            context.register_event_handler(handler)
        respawn = self._respawn
        if not isinstance(respawn, bool):
            respawn = perform_substitutions(context, respawn).lower() in ("true", "1")
        words, env = self.words(context), self.environment(context)
        output = self._output if isinstance(self._output, dict) else perform_substitutions(context, self._output)
        context.runner.start(
            self,
            argv=words,
            called=self.called(context),
            env=_with_ros2(words, env, context),
            cwd=perform_substitutions(context, self._cwd) if self._cwd else None,
            on_screen=isinstance(output, dict) or output in ("screen", "both", "own_log"),
            respawn=respawn,
            timeouts_s=tuple(float(perform_substitutions(context, text)) for text in self._timeouts),
        )
        return None

    def _orders(self, context: Any) -> list[EventHandler]:
        """Events by which others end it, or send it a signal."""

        def end(event: Any, context: Any) -> list[LaunchDescriptionEntity]:
            context.runner.end(self)
            return []

        def send(event: Any, context: Any) -> list[LaunchDescriptionEntity]:
            context.runner.send(self, event.signal)
            return []

        return [_Order(self, ShutdownProcess, end), _Order(self, SignalProcess, send)]


def _with_ros2(words: list[str], env: dict[str, str], context: Any) -> dict[str, str]:
    """The variables with a `PATH` where `ros2` is found, if the command calls it; ours where there is no other."""
    if not any(_ROS2.search(word) for word in words):
        return env
    path = env.get("PATH", context.environment.get("PATH", os.defpath))
    folder = folder_with_ros2(path)
    return env if folder is None else {**env, "PATH": f"{path}{os.pathsep}{folder}"}


class _Order(EventHandler):
    def __init__(self, action: ExecuteProcess, kind: type[Any], then: Any) -> None:
        super().__init__(matcher=lambda event: isinstance(event, kind) and event.process_matcher(action))
        self._then = then

    def handle(self, event: Any, context: Any) -> list[LaunchDescriptionEntity]:
        return flatten(self._then(event, context))


class ExecuteLocal(ExecuteProcess):
    """The same, of an `Executable`: what it is, apart from how it is kept."""

    def __init__(self, *, process_description: Any, **options: Any) -> None:
        super().__init__(cmd=process_description.cmd, **{**process_description.options, **options})
