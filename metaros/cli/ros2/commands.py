"""`metaros ros2`: run programs that were written for ROS 2's Python, unchanged and without an installation of it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from metaros.cli.ros2.bridge import bridge
from metaros.cli.ros2.launch import launch
from metaros.cli.shared.options import Format, FormatOption

__all__ = ["register"]

group = typer.Typer(name="ros2", no_args_is_help=True, help="Programs written for ROS 2's Python, as they are.")
# All that comes after the program is the program's, options included.
_UNREAD = {"ignore_unknown_options": True, "allow_interspersed_args": False}

PackagePath = Annotated[
    list[Path] | None,
    typer.Option("--package-path", metavar="DIR", help="Where packages are that nobody has built; several times."),
]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("run", context_settings=_UNREAD)
def run(
    what: Annotated[list[str], typer.Argument(metavar="FILE|MODULE|PACKAGE EXECUTABLE [ARGS]", help="What to run.")],
    package_path: PackagePath = None,
) -> None:
    """Run a program with its arguments; `--ros-args -r … -p …` at the end is for its nodes. Its exit code is ours."""
    from metaros.ros2.programs import find_program, run_program

    program, rest = find_program(what, package_path=package_path or ())
    if sys.path and program.file is not None:
        del sys.path[0]  # of the command `metaros`: the program's own folder comes in its place
    run_program(program, rest, say=lambda note: sys.stderr.write(f"note: {note}\n"))


group.command("launch")(launch)
group.command("bridge")(bridge)


@group.command("list")
def list_(
    package: Annotated[str, typer.Argument(metavar="PACKAGE", help="Of this package alone.")] = "",
    package_path: PackagePath = None,
    output: FormatOption = Format.TEXT,
) -> None:
    """List the executables of packages: built, installed, or in source beneath the current folder."""
    from metaros.cli.shared.output import Output
    from metaros.ros2.programs import executables

    out = Output(output)
    found = sorted(
        {row for row in executables(package_path=(*(package_path or ()), Path())) if package in ("", row.package)}
    )
    if out.json:
        out.objects([{"package": row.package, "executable": row.name, "where": row.where} for row in found])
    else:
        for row in found:
            out.line(f"{row.package} {row.name}")
    if not found and package:
        from metaros.errors import ConfigError

        raise ConfigError(f"package {package} has no executables here")
