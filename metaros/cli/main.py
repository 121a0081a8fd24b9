"""The program `metaros`: finds the noun, runs it, and turns errors into one line and an exit code.

Exit codes: 0 done, 1 the other side failed or nobody is there, 2 the command was wrong, 130 Ctrl-C.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from metaros import __version__
from metaros.cli.nouns import NounCommands
from metaros.errors import MetarosError, UsageError

__all__ = ["build_app", "exit_code", "main"]


class NounGroup(TyperGroup):
    """The top level: its commands come from the table of nouns."""

    def __init__(self, **attrs: Any) -> None:
        super().__init__(**{**attrs, "commands": None})
        self.commands = NounCommands()

    def list_commands(self, ctx: Any) -> list[str]:
        """All nouns, in the table's order."""
        return list(self.commands)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Our own page, from the table of nouns."""
        from metaros.cli.help import help_page

        assert isinstance(self.commands, NounCommands)
        sys.stdout.write(help_page(self.commands.table.values(), version=__version__))


def _version(value: bool) -> None:
    if value:
        typer.echo(f"metaros {__version__}")
        raise typer.Exit


def build_app() -> typer.Typer:
    """The typer app, nouns and plug-ins included (they load at first use)."""
    app = typer.Typer(
        name="metaros",
        cls=NounGroup,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_root)
    return app


def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show it, exit.")
    ] = False,
    ca: Annotated[
        Path | None, typer.Option("--ca", metavar="FILE", help="PEM of the roots that alone vouch for a gateway.")
    ] = None,
    context: Annotated[
        str, typer.Option("--context", metavar="NAME", help="Ask the gateway of that name, see `metaros context`.")
    ] = "",
) -> None:
    """Robots on the ROS 2 wire, and the cloud-edge gateway above them."""
    if ca is not None:
        os.environ["METAROS_CA"] = str(ca)
    if context:
        os.environ["METAROS_CONTEXT"] = context


def main(argv: Sequence[str] | None = None) -> None:
    """Run `metaros` with `argv` (default: the process's own arguments) and exit."""
    command = typer.main.get_command(build_app())
    try:
        command.main(args=None if argv is None else list(argv), prog_name="metaros")
    except MetarosError as error:
        _say(error)
        sys.exit(exit_code(error))
    except BrokenPipeError:
        _close_stdout()
        sys.exit(0)
    except SystemExit:
        _flush()
        raise


def exit_code(error: MetarosError) -> int:
    """2 for the caller's fault, 1 for everything else."""
    return 2 if isinstance(error, UsageError) else 1


def _say(error: MetarosError) -> None:
    """The first line in red, further lines (what to do) plain."""
    from metaros.sanitize import sanitize_lines  # what it says may be of a robot or a server

    first, _, rest = sanitize_lines(str(error) or error.code).partition("\n")
    if sys.stderr.isatty() and "NO_COLOR" not in os.environ:
        first = f"\x1b[1;31m✗\x1b[0m \x1b[31m{first}\x1b[0m"
    else:
        first = f"error: {first}"
    sys.stderr.write(f"{first}\n{rest}{chr(10) if rest else ''}")


def _flush() -> None:
    """Write what is buffered now: a reader that went away is no failure of ours."""
    try:
        sys.stdout.flush()
    except OSError:
        _close_stdout()


def _close_stdout() -> None:
    """Point stdout to nowhere, or Python complains about the broken pipe while it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
