"""`metaros ros2 bridge`: topics of robots behind zenoh-bridge-ros2dds in the ROS graph, and back."""

from __future__ import annotations

from typing import Annotated

import typer

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, StatusFile, ZenohPort

__all__ = ["bridge"]

_TOPIC = typer.Option("--topic", metavar="NAME:=TYPE", help="Bridge this topic both ways, announced or not; repeat it.")
_PREFIX = typer.Option(
    "--prefix", metavar="KEY", help="What the other bridge puts before its keys.", show_default=False
)
_ONLY = typer.Option("--only", metavar="NAME", help="Bridge only these topics; wildcards * and **.")
_EXCLUDE = typer.Option("--exclude", metavar="NAME", help="Never bridge these; wildcards as above.")


def bridge(
    topic: Annotated[list[str] | None, _TOPIC] = None,
    prefix: Annotated[str, _PREFIX] = "",
    only: Annotated[list[str] | None, _ONLY] = None,
    exclude: Annotated[list[str] | None, _EXCLUDE] = None,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    status_file: StatusFile = "",
) -> None:
    """Bridge topics of a zenoh-bridge-ros2dds on the same router to the ROS graph and back, until Ctrl-C.

    Its topics are found by what it announces. Services and actions are not bridged. One bridge a router.
    """
    from metaros.cli.shared import running
    from metaros.cli.shared.connection import connect
    from metaros.cli.shared.output import Output
    from metaros.idl.globs import Glob
    from metaros.node.mixed.plain_keys import PlainKeyBridge

    chosen, never = tuple(map(Glob, only or ())), tuple(map(Glob, exclude or ()))

    def allows(name: str) -> bool:
        return (not chosen or any(glob.matches(name) for glob in chosen)) and not any(
            glob.matches(name) for glob in never
        )

    out, table = Output(), dict(map(_row, topic or ()))
    with running.stop_on_signals() as stop, connect(zenoh_port, domain) as context:
        with PlainKeyBridge(context, topics=table, prefix=prefix, allows=allows, notice=out.line):
            running.write_status(running.status_file(status_file), zenoh_port=zenoh_port)
            out.note("Ctrl-C stops")
            stop.wait()
    out.line("stopped")


def _row(text: str) -> tuple[str, str]:
    from metaros.cli.shared.types import full_type
    from metaros.errors import UsageError

    name, sign, kind = text.partition(":=")
    if not (name and sign and kind):
        raise UsageError(f"--topic {text!r} is not NAME:=TYPE, such as /scan:=sensor_msgs/msg/LaserScan")
    return name, full_type(kind)
