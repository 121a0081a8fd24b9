"""`metaros up`: gateway, dashboard, simulated robots and this machine, all from one command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from metaros import __version__
from metaros.cli.shared.options import CredentialsFolder, Domain, ProfileOption, ZenohProfile

__all__ = ["register"]

Robots = Annotated[int, typer.Option("--robots", "-n", min=0, max=50, metavar="N", help="Simulated robots.")]
HttpPort = Annotated[
    int | None,
    typer.Option("--port", "-p", min=1, max=65535, metavar="PORT", show_default="8080", help="Dashboard and API."),
]
GrpcPort = Annotated[
    int | None,
    typer.Option("--grpc-port", min=1, max=65535, metavar="PORT", show_default="8081", help="The agents' link."),
]
RouterPort = Annotated[
    int | None,
    typer.Option(
        "--zenoh-port",
        min=1,
        max=65535,
        envvar="METAROS_ZENOH_PORT",
        metavar="PORT",
        show_default="7447",
        help="The Zenoh router's.",
    ),
]
Host = Annotated[
    str, typer.Option("--host", metavar="ADDRESS", help="Address of dashboard, API and link; 0.0.0.0 for all.")
]
Tls = Annotated[
    str, typer.Option("--tls", metavar="auto|on|off", help="TLS; auto: beyond this machine, and with --tls-cert.")
]
TlsCert = Annotated[
    Path | None, typer.Option("--tls-cert", dir_okay=False, help="PEM of a certificate made elsewhere, and its chain.")
]
TlsKey = Annotated[Path | None, typer.Option("--tls-key", dir_okay=False, help="PEM of its key, not encrypted.")]
AllowHost = Annotated[
    list[str] | None, typer.Option("--allow-host", help="Another name browsers may call the gateway by.")
]
Anonymous = Annotated[
    bool, typer.Option("--anonymous/--no-anonymous", help="Who has not signed in may look, on this machine only.")
]
DataDir = Annotated[
    Path | None,
    typer.Option(
        "--data-dir", metavar="DIR", show_default="the user's data folder", help="Where data and logs are kept."
    ),
]
Seed = Annotated[int, typer.Option("--seed", metavar="N", help="Of the simulation.")]
ThisHost = Annotated[bool, typer.Option("--this-host/--no-host", help="This machine as a robot too.")]
Camera = Annotated[
    str, typer.Option("--camera", metavar="SOURCE", help="A camera of this machine: 0, a file, rtsp://…, test.")
]
Replicas = Annotated[
    int, typer.Option("--replicas", min=1, max=5, metavar="N", help="Gateways beside each other, on one --database.")
]
Database = Annotated[
    str,
    typer.Option(
        "--database",
        metavar="URL",
        envvar="METAROS_STORE",
        show_envvar=False,
        help="postgresql://user@host/database instead of a file.",
    ),
]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("up")(up)


def up(
    robots: Robots = 3,
    port: HttpPort = None,
    grpc_port: GrpcPort = None,
    zenoh_port: RouterPort = None,
    host: Host = "127.0.0.1",
    tls: Tls = "auto",
    tls_cert: TlsCert = None,
    tls_key: TlsKey = None,
    allow_host: AllowHost = None,
    anonymous: Anonymous = True,
    data_dir: DataDir = None,
    replicas: Replicas = 1,
    database: Database = "",
    seed: Seed = 1,
    this_host: ThisHost = True,
    camera: Camera = "",
    domain: Domain = 0,
    zenoh_profile: ProfileOption = ZenohProfile.OPEN,
    zenoh_credentials: CredentialsFolder = None,
) -> None:
    """Start everything on this machine and stay until Ctrl-C.

    A default port in use moves to a free one; a port that you name and that is in use is an error.
    """
    import asyncio

    from metaros.cli.shared.extras import require
    from metaros.cli.up.planning import UpOptions
    from metaros.cli.up.run import run
    from metaros.cli.up.screen import Screen
    from metaros.clock import SystemClock, system_rng
    from metaros.wire.profile import default_folder

    require("agent", "gateway")
    clock = SystemClock()
    screen = Screen(clock=clock)
    screen.title(__version__)
    options = UpOptions(
        host=host,
        port=port,
        grpc_port=grpc_port,
        zenoh_port=zenoh_port,
        domain=domain,
        robots=robots,
        data_dir=data_dir.resolve() if data_dir else None,
        seed=seed,
        host_robot=this_host,
        camera=camera,
        tls=tls,
        tls_cert=tls_cert.resolve() if tls_cert else None,
        tls_key=tls_key.resolve() if tls_key else None,
        allow_hosts=tuple(allow_host or ()),
        anonymous=anonymous,
        replicas=replicas,
        database=database,
        protected=(zenoh_credentials or default_folder()) if zenoh_profile is ZenohProfile.PROTECTED else None,
    )
    asyncio.run(run(options, screen, clock=clock, rng=system_rng()))
