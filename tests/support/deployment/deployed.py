"""Commands as deployment files write them, held against the command line that there is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import click
import typer

from gateway.cli.gateway import _settings
from gateway.settings import Settings

__all__ = ["options_of", "settings_of"]


def options_of(words: Sequence[str]) -> tuple[str, dict[str, Any]]:
    """The command that `metaros WORDS…` is, as "gateway" or "user add", and what its options are given.

    Raises:
        click.UsageError: there is no such command, no such option, or its value is none.
    """
    from metaros.cli.main import build_app

    command: click.Command = typer.main.get_command(build_app())
    path, rest = [], list(words)
    while rest and rest[0] in getattr(command, "commands", {}):
        path.append(rest.pop(0))
        command = command.commands[path[-1]]  # type: ignore[attr-defined]
    if not path:
        raise click.UsageError(f"metaros has no command {words[:1]}")
    context = command.make_context(path[-1], rest)
    if path == ["agent-slot"]:  # what it does not know is the agent's
        return "agent", options_of(["agent", *context.args])[1]
    return " ".join(path), context.params


def settings_of(words: Sequence[str], **environ: str) -> Settings:
    """The gateway's settings of `metaros gateway …`, checked as it checks them; ConfigError."""
    name, given = options_of(words)
    assert name == "gateway", name
    given = {key: value for key, value in given.items() if key != "status_file"}
    return _settings(given | environ)
