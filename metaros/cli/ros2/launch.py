"""`metaros ros2 launch`: Python launch files of ROS 2, as they are."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["launch"]

ShowArgs = Annotated[
    bool, typer.Option("--show-args", "-s", help="Show the arguments that the file declares, and start nothing.")
]
Debug = Annotated[bool, typer.Option("--debug", "-d", help="Let errors of the launch file come with their trace.")]


def launch(
    what: Annotated[list[str], typer.Argument(metavar="FILE|PACKAGE FILE [NAME:=VALUE]...", help="The launch file.")],
    show_args: ShowArgs = False,
    debug: Debug = False,
) -> None:
    """Run a Python launch file until all that it started has ended, or Ctrl-C. A package's is sought in its share."""
    from metaros.ros2 import install

    path, arguments = _find(what)
    install(shadow=True)
    from metaros.ros2.launch import LaunchDescription, LaunchService
    from metaros.ros2.launch.actions import IncludeLaunchDescription
    from metaros.ros2.launch.launch_description_sources import (
        InvalidPythonLaunchFileError,
        get_launch_description_from_python_launch_file,
    )

    sys.argv = [str(path), *what]
    if show_args:
        try:
            found = get_launch_description_from_python_launch_file(str(path))
        except InvalidPythonLaunchFileError as error:
            raise ConfigError(str(error)) from None
        _show(found.get_launch_arguments())
        return
    service = LaunchService(argv=what, debug=debug)
    include = IncludeLaunchDescription(str(path), launch_arguments=arguments)
    service.include_launch_description(LaunchDescription([include]))
    raise typer.Exit(service.run())


def _find(words: Sequence[str]) -> tuple[Path, dict[str, str]]:
    """The file, and the arguments. ConfigError where there is no such file, or a word that is no argument."""
    names = [word for word in words if ":=" not in word]
    arguments = dict(word.split(":=", 1) for word in words if ":=" in word)
    if len(names) == 1:
        path = Path(names[0])
        if not path.is_file():
            raise ConfigError(f"there is no launch file {path}")
        return path, arguments
    if len(names) != 2:
        raise ConfigError("what shall be launched? a FILE, or a PACKAGE and its FILE, and then name:=value")
    return _in_package(*names), arguments


def _in_package(package: str, name: str) -> Path:
    from metaros.ros2.ament_index_python.packages import get_package_share_directory

    try:
        share = Path(get_package_share_directory(package))
    except LookupError as error:
        raise ConfigError(str(error)) from None
    found = sorted(path for path in share.rglob(name) if path.is_file())
    if not found:
        there = sorted(path.name for path in share.rglob("*launch*.py"))
        raise ConfigError(f"package {package} has no launch file {name}; there are: {', '.join(there) or 'none'}")
    return found[0]


def _show(arguments: list[Any]) -> None:
    from metaros.ros2.launch.substitution import normalize_to_list_of_substitutions

    if not arguments:
        typer.echo("no arguments")
    for argument in arguments:
        typer.echo(f"{argument.name}:")
        typer.echo(f"    {argument.description}")
        if argument.choices is not None:
            typer.echo(f"    one of: {', '.join(argument.choices)}")
        if argument.default_value is None:
            typer.echo("    must be given")
        else:
            parts = normalize_to_list_of_substitutions(argument.default_value)
            typer.echo(f"    default: {' + '.join(part.describe() for part in parts)}")
