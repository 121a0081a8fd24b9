"""`metaros broker`: a hub for ZeroMQ publishers and subscribers, bridged both ways to ROS topics."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, StatusFile, ZenohPort

if TYPE_CHECKING:
    from threading import Event

    from metaros.broker import Broker, BrokerOptions
    from metaros.cli.shared.output import Output

__all__ = ["register"]

REPORT_S, NEWS_S = 1.0, 0.5
LOOPBACK = ("127.", "localhost", "[::1]")
_XSUB = typer.Option(
    "--xsub", metavar="ENDPOINT", show_default="5555", help="Where publishers connect: a port, tcp:// or ipc://."
)
_XPUB = typer.Option("--xpub", metavar="ENDPOINT", show_default="5556", help="Where subscribers connect.")
_MAP = typer.Option("--map", metavar="TOPIC=TYPE", help="/chatter=std_msgs/String; wildcards * and ** in TOPIC.")
_ONLY = typer.Option("--only", metavar="TOPIC", help="Bridge only these topics; wildcards as above.")
_TWO_FRAMES = typer.Option("--two-frames", help="Send subscribers topic and payload as two frames, not as one.")
_STRICT_JSON = typer.Option("--strict-json", help="Send null for NaN and infinities, which only Python reads.")
_HWM = typer.Option("--hwm", min=1, max=1_000_000, metavar="N", help="Messages that may wait for a subscriber.")


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("broker")(broker)


def broker(
    xsub: Annotated[list[str] | None, _XSUB] = None,
    xpub: Annotated[list[str] | None, _XPUB] = None,
    host: Annotated[str, typer.Option("--host", metavar="ADDRESS", help="Address to listen on.")] = "127.0.0.1",
    types: Annotated[list[str] | None, _MAP] = None,
    only: Annotated[list[str] | None, _ONLY] = None,
    two_frames: Annotated[bool, _TWO_FRAMES] = False,
    strict_json: Annotated[bool, _STRICT_JSON] = False,
    hwm: Annotated[int, _HWM] = 1000,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    status_file: StatusFile = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Bridge ZeroMQ programs to ROS topics until Ctrl-C.

    Publishers connect to port 5555, subscribers to 5556, as with the broker of `metaros` 1.x, whose programs work
    unchanged. Hosts the Zenoh router where none runs.
    """
    from metaros.cli.shared import extras, running
    from metaros.cli.shared.hosted_router import hosted_router
    from metaros.cli.shared.output import Output

    extras.require("zmq")
    from metaros.broker import Broker, BrokerOptions, HubOptions, TypeTable, endpoint
    from metaros.idl.globs import Glob

    hub = HubOptions(
        xsub=tuple(endpoint(text, host=host) for text in xsub or ["5555"]),
        xpub=tuple(endpoint(text, host=host) for text in xpub or ["5556"]),
        hwm=hwm,
    )
    options = BrokerOptions(
        hub=hub,
        types=TypeTable.parse(types or ()),
        only=tuple(Glob(text) for text in only or ()),
        two_frames=two_frames,
        strict_json=strict_json,
    )
    _check_ports(hub.xsub + hub.xpub)
    out = Output(output)
    with running.stop_on_signals() as stop, hosted_router(zenoh_port, "broker") as hosted:
        from metaros.cli.shared.connection import connect

        with connect(zenoh_port, domain) as context, Broker(context, options) as running_broker:
            _greet(out, options, zenoh_port, hosted=hosted)
            running.write_status(running.status_file(status_file), xsub=hub.xsub, xpub=hub.xpub, zenoh_port=zenoh_port)
            _watch(out, running_broker, stop)
    if not out.json:
        typer.echo("stopped")


def _check_ports(endpoints: tuple[str, ...]) -> None:
    """An error that names who has a port: nobody would find the hub on another one, so it never moves."""
    from metaros.cli.shared.ports import port_free, port_owner
    from metaros.errors import ConfigError

    for where in endpoints:
        transport, _, address = where.partition("://")
        name, _, port = address.rpartition(":")
        if transport == "tcp" and name.replace(".", "").isdigit() and not port_free(int(port), host=name):
            raise ConfigError(
                f"port {port} is in use by {port_owner(int(port))}\n"
                "choose others: metaros broker --xsub PORT --xpub PORT, and tell the ZeroMQ programs"
            )


def _greet(out: Output, options: BrokerOptions, zenoh_port: int, *, hosted: bool) -> None:
    hub = options.hub
    beyond = [where for where in hub.xsub + hub.xpub if not where.partition("://")[2].startswith(LOOPBACK)]
    beyond = [where for where in beyond if not where.startswith("ipc:")]
    if beyond:
        sys.stderr.write(
            f"warning: {' and '.join(beyond)} can be reached from other hosts, and ZeroMQ has no authentication: "
            "whoever reaches it can read and publish every topic\n"
        )
    if out.json:
        return
    out.line(f"publishers connect to   {out.style('  '.join(hub.xsub), '36')}")
    out.line(f"subscribers connect to  {out.style('  '.join(hub.xpub), '36')}")
    router = "hosted here" if hosted else "joined"
    out.line(f"Zenoh router            tcp/127.0.0.1:{zenoh_port}, {router}  (Ctrl-C stops)")


def _watch(out: Output, broker: Broker, stop: Event) -> None:
    """Show what passes until asked to stop."""
    from metaros.cli.broker.screen import Watcher, live, report_facts
    from metaros.clock import SystemClock

    watcher = Watcher(SystemClock())
    if out.json:
        while not stop.wait(REPORT_S):
            out.object_line(report_facts(watcher.look(broker.report())))
    elif out.tty:
        live(lambda: watcher.look(broker.report()), stop)
    else:
        while not stop.wait(NEWS_S):
            for line in watcher.news(broker.report()):
                out.line(line)
