"""`metaros router`: host the Zenoh router that lets the nodes of this machine find each other."""

from __future__ import annotations

from socket import gethostname
from typing import TYPE_CHECKING, Annotated

import typer

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, CredentialsFolder, ProfileOption, StatusFile, ZenohProfile

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from threading import Event

    from metaros.wire import Router

__all__ = ["open_or_join", "register"]

OTHER_PORT = "metaros router --port PORT"
STANDBY_STEP_S = 0.5
STANDBY_STEPS = 3  # so often in a row must the port be free: a router that is only restarted comes back to it


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("router")(router)


def router(
    port: Annotated[
        int,
        typer.Option(
            "--port", "--zenoh-port", envvar="METAROS_ZENOH_PORT", min=1, max=65535, metavar="PORT", help="TCP port."
        ),
    ] = DEFAULT_ZENOH_PORT,
    host: Annotated[str, typer.Option("--host", metavar="ADDRESS", help="Address to listen on.")] = "127.0.0.1",
    standby: Annotated[
        bool, typer.Option("--standby", help="Wait until the port is free, then host: a router's understudy.")
    ] = False,
    connect: Annotated[
        list[str] | None,
        typer.Option("--connect", metavar="tcp/HOST:PORT", help="Another router to be one network with; repeat it."),
    ] = None,
    zenoh_profile: ProfileOption = ZenohProfile.OPEN,
    zenoh_credentials: CredentialsFolder = None,
    status_file: StatusFile = "",
) -> None:
    """Host a Zenoh router until Ctrl-C. Where one runs already there is nothing to do, and it says so."""
    from metaros.cli.shared import running
    from metaros.errors import UsageError
    from metaros.wire.profile import default_folder
    from metaros.wire.router import other_routers

    if connect and zenoh_profile is ZenohProfile.PROTECTED:
        raise UsageError("--connect is of the open profile: protected routers let no other router in")
    others = other_routers(connect or (), own_host=gethostname(), port=port)
    folder = (zenoh_credentials or default_folder()) if zenoh_profile is ZenohProfile.PROTECTED else None

    with running.stop_on_signals() as stop:
        if standby:
            hosted = _await_port(port, host, stop, folder, others)
        elif (hosted := open_or_join(port, host, OTHER_PORT, protected=folder, connect=others)) is None:
            typer.echo(f"a Zenoh router runs already on tcp/{host}:{port}; nodes on this machine use it")
            return
        if hosted is not None:
            with hosted:
                running.write_status(running.status_file(status_file), zenoh_port=port, endpoint=hosted.endpoint)
                typer.echo(f"Zenoh router on {hosted.endpoint}  (Ctrl-C stops it)")
                if folder is not None:
                    typer.echo(f"protected: sessions need ZENOH_SESSION_CONFIG_URI={folder}/node.json5")
                running.wait_for_stop(stop)
    typer.echo("stopped")


def open_or_join(
    port: int, host: str, other: str, *, protected: Path | None = None, connect: Sequence[str] = ()
) -> Router | None:
    """A router of our own, or None where there is one already; ConfigError where the port is another program's, or
    where a router is to be `protected` and one that is not has the port: `other` is the command for another port.
    """
    from metaros.cli.shared.ports import port_owner
    from metaros.errors import ConfigError
    from metaros.wire.router import open_router, probe

    state = probe(port, host=host)
    if state == "foreign":
        raise ConfigError(f"port {port} is in use by {port_owner(port)}\nchoose another: {other}")
    if state == "zenoh" and protected is not None:
        raise ConfigError(f"an open Zenoh router has port {port} already: end it, or choose another: {other}")
    return None if state == "zenoh" else open_router(port, host=host, protected=protected, connect=connect)


def _await_port(port: int, host: str, stop: Event, protected: Path | None, connect: Sequence[str]) -> Router | None:
    """Wait for the port; None when asked to stop. Of several understudies one gets it, the others wait on."""
    from metaros.cli.shared.ports import port_free
    from metaros.errors import ConfigError
    from metaros.wire.router import open_router

    typer.echo(f"waiting for tcp/{host}:{port} to be free")
    free = 0
    while not stop.wait(STANDBY_STEP_S):
        free = free + 1 if port_free(port, host=host) else 0
        if free >= STANDBY_STEPS:
            try:
                return open_router(port, host=host, protected=protected, connect=connect)
            except ConfigError:  # another understudy was faster
                free = 0
    return None
