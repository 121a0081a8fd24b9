"""`metaros router`: host the Zenoh router that lets the nodes of this machine find each other."""

from __future__ import annotations

from typing import Annotated

import typer

from metaros.cli.options import DEFAULT_ZENOH_PORT, StatusFile

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("router")(router)


def router(
    port: Annotated[
        int,
        typer.Option("--port", "--zenoh-port", envvar="METAROS_ZENOH_PORT", min=1, max=65535, help="TCP port."),
    ] = DEFAULT_ZENOH_PORT,
    host: Annotated[str, typer.Option("--host", help="Address to listen on.")] = "127.0.0.1",
    status_file: StatusFile = "",
) -> None:
    """Host a Zenoh router until Ctrl-C. Where one runs already there is nothing to do, and it says so."""
    from metaros.cli import running
    from metaros.cli.up_ports import port_owner
    from metaros.errors import ConfigError
    from metaros.wire.router import open_router, probe

    state = probe(port, host=host)
    if state == "zenoh":
        typer.echo(f"a Zenoh router runs already on tcp/{host}:{port}; nodes on this machine use it")
        return
    if state == "foreign":
        raise ConfigError(f"port {port} is in use by {port_owner(port)}\nchoose another: metaros router --port PORT")
    with running.stop_on_signals() as stop:
        with open_router(port, host=host) as router:
            running.write_status(running.status_file(status_file), zenoh_port=port, endpoint=router.endpoint)
            typer.echo(f"Zenoh router on {router.endpoint}  (Ctrl-C stops it)")
            stop.wait()
    typer.echo("stopped")
