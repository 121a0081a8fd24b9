"""`metaros dds`: topics and services of robots on Fast DDS or Cyclone DDS, bridged to the ROS graph and back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, StatusFile, ZenohPort

if TYPE_CHECKING:
    from threading import Event

    from metaros.cli.shared.output import Output
    from metaros.dds import DdsBridge

__all__ = ["register"]

REPORT_S, NEWS_S = 1.0, 0.5
_DDS_DOMAIN = typer.Option(
    "--dds-domain", min=0, max=232, metavar="ID", envvar="ROS_DOMAIN_ID", help="The robots' ROS_DOMAIN_ID on DDS."
)
_ONLY = typer.Option("--only", metavar="NAME", help="Bridge only these topics and services; wildcards * and **.")
_EXCLUDE = typer.Option("--exclude", metavar="NAME", help="Never bridge these; wildcards as above.")
_SERVICES = typer.Option("--services/--no-services", help="Bridge services, too.")


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("dds")(dds)


def dds(
    dds_domain: Annotated[int, _DDS_DOMAIN] = 0,
    only: Annotated[list[str] | None, _ONLY] = None,
    exclude: Annotated[list[str] | None, _EXCLUDE] = None,
    services: Annotated[bool, _SERVICES] = True,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    status_file: StatusFile = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Bridge robots on DDS to the ROS graph until Ctrl-C.

    Their topics are listed, echoed, recorded and forwarded as any other, and they hear what is published here. Types
    are those of the catalogue and of METAROS_INTERFACE_PATH. Services are those of Cyclone DDS.
    Hosts the Zenoh router where none runs. One bridge a DDS domain.
    """
    from metaros.cli.shared import extras, running
    from metaros.cli.shared.hosted_router import hosted_router
    from metaros.cli.shared.output import Output

    extras.require("dds")
    from metaros.dds import DdsBridge, DdsOptions
    from metaros.idl.globs import Glob

    options = DdsOptions(
        domain=dds_domain,
        only=tuple(Glob(text) for text in only or ()),
        exclude=tuple(Glob(text) for text in exclude or ()),
        services=services,
    )
    out = Output(output)
    with running.stop_on_signals() as stop, hosted_router(zenoh_port, "dds") as hosted:
        from metaros.cli.shared.connection import connect

        with connect(zenoh_port, domain) as context, DdsBridge(context, options) as bridge:
            if not out.json:
                router = "hosted here" if hosted else "joined"
                out.line(f"DDS domain    {out.style(str(dds_domain), '36')}")
                out.line(f"Zenoh router  tcp/127.0.0.1:{zenoh_port}, {router}  (Ctrl-C stops)")
            running.write_status(running.status_file(status_file), dds_domain=dds_domain, zenoh_port=zenoh_port)
            _watch(out, bridge, stop)
    if not out.json:
        typer.echo("stopped")


def _watch(out: Output, bridge: DdsBridge, stop: Event) -> None:
    """Show what passes until asked to stop."""
    from metaros.cli.dds.screen import Watcher, live, report_facts
    from metaros.clock import SystemClock

    watcher = Watcher(SystemClock())
    if out.json:
        while not stop.wait(REPORT_S):
            out.object_line(report_facts(watcher.look(bridge.report())))
    elif out.tty:
        live(lambda: watcher.look(bridge.report()), stop)
    else:
        while not stop.wait(NEWS_S):
            for line in watcher.news(bridge.report()):
                out.line(line)
