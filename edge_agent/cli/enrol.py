"""`metaros agent enrol`: make this machine a robot of a fleet, with a token that its gateway gave."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from metaros.errors import MetarosError
from metaros.sanitize import sanitize, sanitize_lines

__all__ = ["enrol_command"]

TOKEN_CHARS = 512


def enrol_command(
    token: Annotated[str, typer.Argument(help="The enrolment token; - reads it from standard input.")],
    gateway: Annotated[str, typer.Option(help="The gateway's URL: https://HOST[:PORT].")],
    name: Annotated[str | None, typer.Option(help="The robot's id at the gateway; default: this host's name.")] = None,
    state_dir: Annotated[
        Path | None, typer.Option(help="The agent's state directory; default: ~/.metaros/agent/NAME.")
    ] = None,
) -> None:
    """Make a key here, have the gateway sign a certificate for it, and keep both for `metaros agent`."""
    from edge_agent.config.settings import load_settings
    from edge_agent.identity.enrol import enrol
    from edge_agent.identity.enrolment_token import parse_token
    from edge_agent.state.state_dir import default_state_dir

    try:
        text = sys.stdin.readline(TOKEN_CHARS) if token == "-" else token
        robot = load_settings(None, {"name": name}).name
        directory = state_dir or default_state_dir(robot)
        identity = enrol(parse_token(text), url=gateway, robot_id=robot, state_dir=directory)
    except MetarosError as error:
        typer.echo(sanitize_lines(f"metaros agent enrol: {error}"), err=True)
        raise typer.Exit(2) from error
    typer.echo(sanitize(f"enrolled {identity.robot} in fleet {identity.fleet}"))
    more = f" --state-dir {state_dir}" if state_dir else ""
    typer.echo(f"start it: metaros agent --name {identity.robot}{more}")
    typer.echo("keep others on this machine from driving it: metaros router --zenoh-profile protected", err=True)
