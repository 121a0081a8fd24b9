"""`metaros topic`: what is published, by whom, how often; echo it, publish to it. The grammar is ros2's."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from metaros.cli.graph_target.target import GraphTarget, graph_command
from metaros.cli.topic import pub, stream, type_lookup

__all__ = ["register"]

group = typer.Typer(name="topic", no_args_is_help=True, help="Topics: list, look, listen, publish.")


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
@graph_command
def list_(
    target: GraphTarget,
    show_types: Annotated[bool, typer.Option("--show-types", "-t", help="Show each topic's type.")] = False,
    count: Annotated[bool, typer.Option("--count-topics", "-c", help="Only how many.")] = False,
    hidden: Annotated[bool, typer.Option("--include-hidden-topics", help="Those of actions, too.")] = False,
) -> None:
    """List the topics of the graph."""
    from metaros.cli.shared.names import is_hidden

    out = target.out
    with target.open_graph() as graph:
        topics = {name: sorted(types) for name, types in graph.topics().items() if hidden or not is_hidden(name)}
        ends = [*graph.endpoints(kind="MP"), *graph.endpoints(kind="MS")]
    if count:
        out.line(str(len(topics)))
    elif out.json:
        out.objects([_summary(name, types, ends) for name, types in topics.items()])
    elif out.tty and show_types:
        rows = [(name, " ".join(types), *_counts(name, ends)) for name, types in topics.items()]
        out.table(("Topic", "Type", "Pub", "Sub"), rows)
    else:
        for name, types in topics.items():
            out.line(f"{name} [{', '.join(types)}]" if show_types else name)
    if not topics:
        out.note("no topics: start a node, or `metaros up`")


def _counts(name: str, endpoints: list[Any]) -> tuple[int, int]:
    kinds = [item.kind for item in endpoints if item.topic == name]
    return kinds.count("MP"), kinds.count("MS")


def _summary(name: str, types: list[str], endpoints: list[Any]) -> dict[str, Any]:
    publishers, subscribers = _counts(name, endpoints)
    return {"topic": name, "types": types, "publishers": publishers, "subscribers": subscribers}


@group.command("info")
@graph_command
def info(
    target: GraphTarget,
    topic: Annotated[str, typer.Argument(metavar="TOPIC", help="Such as /sim_1/odom.")],
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Each publisher and subscriber, with QoS.")] = False,
) -> None:
    """Show a topic's type, publishers and subscribers."""
    from metaros.cli.shared.endpoints import endpoint_facts, print_endpoints
    from metaros.cli.shared.names import no_such
    from metaros.cli.topic.incompatibilities import print_problems, problems

    out, name = target.out, target.absolute(topic)
    with target.open_graph() as graph:
        ends = [item for item in graph.endpoints(topic=name) if item.kind in ("MP", "MS")]
        known, found = list(graph.topics()), problems(graph.tokens(), name)
    if not ends:
        raise no_such("topic", name, known)
    if out.json:
        facts = [endpoint_facts(item) for item in ends]
        types = sorted({item.type_name for item in ends})
        out.objects({"topic": name, "types": types, "endpoints": facts, "incompatible": found})
        return
    print_endpoints(out, ends, (("MP", "Publisher count"), ("MS", "Subscription count")), verbose=verbose)
    print_problems(out, found, verbose=verbose)


group.command("type")(type_lookup.type_)
group.command("find")(type_lookup.find)
group.command("echo")(stream.echo)
group.command("hz")(stream.hz)
group.command("bw")(stream.bw)
group.command("delay")(stream.delay)
group.command("pub")(pub.pub)
