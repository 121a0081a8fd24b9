"""Run a program as `ros2 run` would, but in this process: as `__main__`, with its arguments and its folder."""

from __future__ import annotations

import importlib
import os
import re
import runpy
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Final, NoReturn

from metaros.errors import ConfigError
from metaros.ros2.finder import install
from metaros.ros2.programs.environment import ignored_settings, set_defaults

__all__ = ["INTERRUPTED", "Program", "run_program"]

INTERRUPTED: Final = 130
_MESSAGES: Final = re.compile(r"^\w+_(msgs|interfaces|srvs|actions)\b|\.(msg|srv|action)\b|^turtlesim$")
_FAILED: Final = 1
_OURS: Final = str(Path(__file__).resolve().parents[2])  # the frames of this library up to the program's own


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """Exactly one of `file`, `module`, `function` and `binary` says what it is."""

    argv0: str
    file: Path | None = None
    module: str = ""
    function: str = ""  # package.module:name
    binary: Path | None = None  # no Python: this process becomes it
    path: tuple[str, ...] = ()  # goes before what Python searches for modules

    def __str__(self) -> str:
        return self.module or self.function or str(self.file or self.binary)


def run_program(program: Program, arguments: Sequence[str], *, say: Callable[[str], object] | None = None) -> NoReturn:
    """Run it to its end, and exit with its code: 130 after a Ctrl-C that it let pass, 1 after an error.

    ROS arguments stay in `sys.argv`, where `rclpy.init` finds them. `say` takes notes of what is set in the
    environment and has no effect here. The names of ROS 2 lead to this library from now on, installed or not.
    """
    sys.argv = [program.argv0, *arguments]
    set_defaults()
    for note in ignored_settings(os.environ) if say is not None else ():
        say(note)  # type: ignore[misc]
    if program.binary is not None:
        _become(program.binary, arguments)
    sys.path[:0] = [part for part in program.path if part not in sys.path[:1]]
    install(shadow=True)
    try:
        code = _run(program)
    except KeyboardInterrupt:
        code = INTERRUPTED
    except SystemExit:
        raise
    except BaseException as error:
        trace = _of_the_program(error.__traceback__)
        if isinstance(error, ModuleNotFoundError) and error.name is not None:
            _add_advice(error, error.name)
        sys.excepthook(type(error), error.with_traceback(trace), trace)
        code = _FAILED
    sys.exit(code)


def _run(program: Program) -> Any:
    if program.file is not None:
        runpy.run_path(str(program.file), run_name="__main__")
    elif program.module:
        runpy.run_module(program.module, run_name="__main__", alter_sys=True)
    else:
        module, _, name = program.function.partition(":")
        function: Any = importlib.import_module(module)
        for part in name.split("."):
            function = getattr(function, part)
        return function()  # as the script that setuptools makes: what it returns is the exit code
    return 0


def _add_advice(error: ModuleNotFoundError, name: str) -> None:
    """What to do where the module is a package of messages, to go by its name."""
    if _MESSAGES.search(name):
        package = name.partition(".")[0]
        error.add_note(
            f"If {package} is a package of messages: METAROS_INTERFACE_PATH names folders that hold {package}/msg, srv "
            "or action, such as the src of a workspace; those of a sourced ROS 2 installation are found by themselves."
        )


def _become(binary: Path, arguments: Sequence[str]) -> NoReturn:
    try:
        os.execv(binary, [str(binary), *arguments])
    except OSError as error:
        raise ConfigError(f"cannot run {binary}: {error.strerror}") from None


def _of_the_program(trace: TracebackType | None) -> TracebackType | None:
    """The trace from the program's first frame on; the whole where it never got so far."""
    inner = trace
    while inner is not None and _is_ours(inner.tb_frame.f_code.co_filename):
        inner = inner.tb_next
    return inner or trace


def _is_ours(file_name: str) -> bool:
    return file_name.startswith((_OURS, "<frozen ")) or file_name in (runpy.__file__, importlib.__file__)
