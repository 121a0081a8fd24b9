"""Files that stand in for commands of ROS 2: executables of packages that nobody has built, and `ros2` itself.

Launch files name such files, or call `ros2`. The stand-ins are in a folder that goes away with this process.
"""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final

from metaros.ros2.programs.lookup import find_program

__all__ = ["executable_file", "folder_with_ros2", "ros2_file"]

_ROS2: Final = """#!/bin/sh
case "$1" in
run | launch) exec {metaros} ros2 "$@" ;;
*) exec {metaros} "$@" ;;
esac
"""


def executable_file(package: str, name: str, environ: Mapping[str, str]) -> Path:
    """A file that runs a package's executable, from any folder. ConfigError where there is none of that name."""
    program, _ = find_program([package, name], environ=environ)
    if program.binary is not None:
        return program.binary
    sources = [word for folder in program.path for word in ("--package-path", str(Path(folder).resolve()))]
    words = shlex.join([*_metaros(), "ros2", "run", *sources, package, name])
    return _script(f"{package}/{name}", f'#!/bin/sh\nexec {words} "$@"\n')


def ros2_file() -> str:
    """A command `ros2` that is this library's: `run` and `launch`, and what else both have by the same names."""
    return str(_script("bin/ros2", _ROS2.format(metaros=shlex.join(_metaros()))))


def folder_with_ros2(path: str | None) -> str | None:
    """A folder for `PATH` that has it; None where `path` has a command `ros2`."""
    return os.path.dirname(ros2_file()) if shutil.which("ros2", path=path) is None else None


def _metaros() -> list[str]:
    return [sys.executable, "-m", "metaros"]


def _script(name: str, text: str) -> Path:
    path = _folder() / name
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "w", encoding="utf-8", opener=_for_the_owner) as file:
            file.write(text)
    return path


def _for_the_owner(path: str, flags: int) -> int:
    return os.open(path, flags, 0o700)


@cache
def _folder() -> Path:
    holder = tempfile.TemporaryDirectory(prefix="metaros-commands-")
    _holders.append(holder)
    return Path(holder.name)


_holders: list[Any] = []  # their folders go away with the process
