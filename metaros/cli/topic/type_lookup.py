"""`metaros topic type` and `find`: from a topic to its type, and from a type to its topics."""

from __future__ import annotations

from typing import Annotated

import typer

from metaros.cli.graph_target.target import GraphTarget, graph_command

__all__ = ["find", "type_"]


@graph_command
def type_(
    target: GraphTarget, topic: Annotated[str, typer.Argument(metavar="TOPIC", help="Such as /sim_1/odom.")]
) -> None:
    """Print a topic's type."""
    from metaros.cli.shared.names import no_such

    out, name = target.out, target.absolute(topic)
    with target.open_graph() as graph:
        topics = graph.topics()
    if name not in topics:
        raise no_such("topic", name, topics)
    out.names(sorted(topics[name]))


@graph_command
def find(
    target: GraphTarget,
    type_name: Annotated[str, typer.Argument(metavar="TYPE", help="Such as nav_msgs/msg/Odometry.")],
    count: Annotated[bool, typer.Option("--count-topics", "-c", help="Only how many.")] = False,
) -> None:
    """List the topics of a type."""
    from metaros.cli.shared.names import known_type

    out = target.out
    with target.open_graph() as graph:
        topics = graph.topics()
    full = known_type(type_name, "msg", {item for types in topics.values() for item in types})
    out.names([name for name, types in topics.items() if full in types], count=count)
