"""`metaros driver`: run the drivers that come with Meta-ROS, each a node."""

from __future__ import annotations

from typing import Annotated

import typer

from metaros.cli.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, StatusFile, ZenohPort
from metaros.errors import ConfigError

__all__ = ["register"]

group = typer.Typer(name="driver", no_args_is_help=True, help="Drivers: list them, run one.")


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
def list_(output: FormatOption = Format.TEXT) -> None:
    """List the kinds of drivers there are."""
    from metaros.cli.output import Output
    from metaros.drivers import DRIVERS

    out = Output(output)
    if out.json:
        out.objects([{"kind": driver.kind, "summary": driver.summary} for driver in DRIVERS])
    else:
        out.table(("Driver", "What it does"), [(driver.kind, driver.summary) for driver in DRIVERS])


@group.command("run")
def run(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="Such as camera; `metaros driver list` shows all.")],
    param: Annotated[
        list[str] | None,
        typer.Option("--param", "-p", metavar="NAME=VALUE", help="A setting; repeat it."),
    ] = None,
    namespace: Annotated[
        str, typer.Option("--namespace", metavar="NAMESPACE", help="Publish below this namespace.")
    ] = "/",
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    status_file: StatusFile = "",
) -> None:
    """Run a driver until Ctrl-C."""
    from metaros.cli import running
    from metaros.cli.connection import connect
    from metaros.drivers import run_driver

    with running.stop_on_signals() as stop, connect(zenoh_port, domain) as context:
        running.write_status(running.status_file(status_file), driver=kind, namespace=namespace)
        run_driver(kind, _parameters(param or []), context=context, namespace=namespace, stop=stop)
    typer.echo("stopped")


def _parameters(pairs: list[str]) -> dict[str, str]:
    """`NAME=VALUE` texts as a dictionary; ConfigError names the one that is none."""
    found: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals or not name:
            raise ConfigError(f"--param {pair!r} is not NAME=VALUE")
        found[name] = value
    return found
