"""`metaros agent-slot`: the agent in the version that updates have brought, behind a loader that none replaces."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["register"]

SETTINGS = {"ignore_unknown_options": True, "allow_extra_args": True, "allow_interspersed_args": False}


def register(app: typer.Typer) -> None:
    """Add the noun `agent-slot` to the program."""
    app.command("agent-slot", context_settings=SETTINGS)(slot_command)


def slot_command(
    context: typer.Context,
    health_s: Annotated[
        float, typer.Option("--health-s", min=0.1, max=86_400, help="A new version is linked for so long to be kept.")
    ] = LIMITS.update_health_s,
    link_s: Annotated[
        float, typer.Option("--link-s", min=0.1, max=86_400, help="And has so long to get there from its start.")
    ] = LIMITS.update_link_s,
    boots: Annotated[
        int, typer.Option("--boots", min=1, max=100, help="Starts that may end before it is taken back.")
    ] = LIMITS.update_boots,
) -> None:
    """Run `metaros agent` with the other arguments, in the version that updates have brought; taken back when bad.

    Put it where `metaros agent` was: the arguments after its own options are the agent's.
    """
    from edge_agent.update.loader import Loader, state_dir_of

    arguments = tuple(context.args)
    named = {option: _value(arguments, option) for option in ("--name", "--state-dir", "--config")}
    state_dir, config = named["--state-dir"], named["--config"]
    try:
        directory = state_dir_of(
            named["--name"], Path(state_dir) if state_dir else None, Path(config) if config else None
        )
        loader = Loader(state_dir=directory, arguments=arguments, health_s=health_s, link_s=link_s, boots=boots)
        code = loader.run()
    except MetarosError as error:
        typer.echo(f"metaros agent-slot: {error}", err=True)
        raise typer.Exit(2) from error
    raise typer.Exit(code)


def _value(arguments: tuple[str, ...], option: str) -> str | None:
    """What an option of the agent was given, the last time."""
    found = None
    for index, word in enumerate(arguments):
        if word == option and index + 1 < len(arguments):
            found = arguments[index + 1]
        elif word.startswith(f"{option}="):
            found = word[len(option) + 1 :]
    return found
