"""`metaros agent`: runs the edge agent; an entry point of the group `metaros.cli`."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import Annotated

import typer

from edge_agent.cli.enrol import enrol_command
from edge_agent.cli.status import status_command
from metaros.errors import MetarosError
from metaros.sanitize import SanitizingFormatter, sanitize_lines

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the noun `agent` to the program."""
    agent = typer.Typer(help="Tap this robot's topics and forward them to a gateway.", no_args_is_help=False)
    agent.callback(invoke_without_command=True)(run_command)
    agent.command("status")(status_command)
    agent.command("enrol")(enrol_command)
    app.add_typer(agent, name="agent")


def run_command(
    context: typer.Context,
    name: Annotated[str | None, typer.Option(help="The robot's id at the gateway; default: this host's name.")] = None,
    namespace: Annotated[str | None, typer.Option(help="Tap only topics under this ROS namespace.")] = None,
    gateway: Annotated[
        str | None, typer.Option(help="Address of the gateway, HOST:PORT or a URL; of several replicas with commas.")
    ] = None,
    zenoh_port: Annotated[
        int | None, typer.Option(help="Port of the Zenoh router on this host.", envvar="METAROS_ZENOH_PORT")
    ] = None,
    zenoh_profile: Annotated[
        str | None, typer.Option(metavar="auto|open|protected", help="How the router guards this robot.")
    ] = None,
    zenoh_credentials: Annotated[
        Path | None, typer.Option(metavar="DIR", help="The protected profile's session files.")
    ] = None,
    config: Annotated[Path | None, typer.Option(help="TOML file with settings and the topic table.")] = None,
    exclude: Annotated[list[str] | None, typer.Option(help="Leave these topics to others, e.g. '/sim_*/**'.")] = None,
    host_metrics: Annotated[
        bool | None, typer.Option("--host-metrics/--no-host-metrics", help="Publish this host's CPU, memory, …")
    ] = None,
    state_dir: Annotated[
        Path | None, typer.Option(help="Where the outbox lives; default: ~/.metaros/agent/NAME.")
    ] = None,
    status_file: Annotated[Path | None, typer.Option(help="Write JSON there once the tap runs.")] = None,
) -> None:
    """Run the agent until Ctrl-C."""
    if context.invoked_subcommand is not None:
        return
    os.environ.setdefault("GRPC_VERBOSITY", "ERROR")  # it reports every lost connection; the uplink does that
    from edge_agent.config.settings import load_settings  # heavy, and the next one too: Zenoh, gRPC, numpy
    from edge_agent.main import run

    handler = logging.StreamHandler()
    handler.setFormatter(SanitizingFormatter("%(asctime)s %(name)s %(levelname)s %(message)s"))
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    overrides = {
        "name": name,
        "namespace": namespace,
        **_gateways(gateway),
        "zenoh_port": zenoh_port,
        "zenoh_profile": zenoh_profile,
        "zenoh_credentials": zenoh_credentials,
        "exclude": exclude or None,
        "host_metrics": host_metrics,
        "state_dir": state_dir,
        "status_file": status_file,
    }
    try:
        run(load_settings(config, overrides))
    except MetarosError as error:
        typer.echo(sanitize_lines(f"metaros agent: {error}"), err=True)
        raise typer.Exit(2) from error


def _gateways(told: str | None) -> dict[str, object]:
    """The setting that `--gateway` means: one gateway, or several replicas of one."""
    names = [part.strip() for part in (told or "").split(",") if part.strip()]
    return {"gateways": tuple(names)} if len(names) > 1 else {"gateway": told}
