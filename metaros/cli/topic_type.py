"""`metaros topic type` and `find`: from a topic to its type, and from a type to its topics."""

from __future__ import annotations

from typing import Annotated

import typer

from metaros.cli.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, SpinTime, ZenohPort

__all__ = ["find", "type_"]


def type_(
    topic: Annotated[str, typer.Argument(metavar="TOPIC", help="Such as /sim_1/odom.")],
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    spin_time: SpinTime = 1.0,
    output: FormatOption = Format.TEXT,
) -> None:
    """Print a topic's type."""
    from metaros.cli.connection import absolute, look
    from metaros.cli.names import no_such
    from metaros.cli.output import Output

    out, name = Output(output), absolute(topic)
    with look(zenoh_port, domain, spin_time=spin_time) as graph:
        topics = graph.topics()
    if name not in topics:
        raise no_such("topic", name, topics)
    out.names(sorted(topics[name]))


def find(
    type_name: Annotated[str, typer.Argument(metavar="TYPE", help="Such as nav_msgs/msg/Odometry.")],
    count: Annotated[bool, typer.Option("--count-topics", "-c", help="Only how many.")] = False,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    spin_time: SpinTime = 1.0,
    output: FormatOption = Format.TEXT,
) -> None:
    """List the topics of a type."""
    from metaros.cli.connection import look
    from metaros.cli.names import known_type
    from metaros.cli.output import Output

    out = Output(output)
    with look(zenoh_port, domain, spin_time=spin_time) as graph:
        topics = graph.topics()
    full = known_type(type_name, "msg", {item for types in topics.values() for item in types})
    out.names([name for name, types in topics.items() if full in types], count=count)
