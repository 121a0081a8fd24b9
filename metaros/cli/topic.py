"""`metaros topic`: what is published, by whom, how often; echo it, publish to it. The grammar is ros2's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli import topic_pub, topic_stream
from metaros.cli.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, SpinTime, ZenohPort

if TYPE_CHECKING:
    from metaros.cli.output import Output

__all__ = ["register"]

group = typer.Typer(name="topic", no_args_is_help=True, help="Topics: list, look, listen, publish.")


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
def list_(
    show_types: Annotated[bool, typer.Option("--show-types", "-t", help="Show each topic's type.")] = False,
    count: Annotated[bool, typer.Option("--count-topics", "-c", help="Only how many.")] = False,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    spin_time: SpinTime = 1.0,
    output: FormatOption = Format.TEXT,
) -> None:
    """List the topics of the graph."""
    from metaros.cli.connection import look
    from metaros.cli.output import Output

    out = Output(output)
    with look(zenoh_port, domain, spin_time=spin_time) as graph:
        topics = {name: sorted(types) for name, types in sorted(graph.topics().items())}
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
def info(
    topic: Annotated[str, typer.Argument(metavar="TOPIC", help="Such as /sim_1/odom.")],
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Each publisher and subscriber, with QoS.")] = False,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    spin_time: SpinTime = 1.0,
    output: FormatOption = Format.TEXT,
) -> None:
    """Show a topic's type, publishers and subscribers."""
    from metaros.cli.connection import absolute, closest, look
    from metaros.cli.output import Output
    from metaros.errors import UnavailableError

    out = Output(output)
    name = absolute(topic)
    with look(zenoh_port, domain, spin_time=spin_time) as graph:
        ends = [item for item in graph.endpoints(topic=name) if item.kind in ("MP", "MS")]
        known = list(graph.topics())
    if not ends:
        hint = closest(name, known) or "`metaros topic list` shows those there are"
        raise UnavailableError(f"no topic {name!r} in the graph\n{hint}")
    if out.json:
        out.objects({"topic": name, "types": _types(ends), "endpoints": [_endpoint(item) for item in ends]})
        return
    _print_info(out, ends, verbose=verbose)


group.command("echo")(topic_stream.echo)
group.command("hz")(topic_stream.hz)
group.command("bw")(topic_stream.bw)
group.command("pub")(topic_pub.pub)


def _types(endpoints: list[Any]) -> list[str]:
    return sorted({item.type_name for item in endpoints})


def _endpoint(item: Any) -> dict[str, Any]:
    gid = item.gid.hex() if isinstance(item.gid, bytes) else str(item.gid)
    return {
        "kind": "publisher" if item.kind == "MP" else "subscriber",
        "node": item.node,
        "namespace": item.namespace,
        "type": item.type_name,
        "type_hash": item.type_hash,
        "gid": gid,
        "qos": _qos(item.qos),
    }


def _qos(qos: Any) -> dict[str, Any]:
    return {
        "reliability": qos.reliability.name,
        "history": qos.history.name,
        "depth": qos.depth,
        "durability": qos.durability.name,
    }


def _print_info(out: Output, endpoints: list[Any], *, verbose: bool) -> None:
    out.line(f"Type: {' or '.join(_types(endpoints))}")
    hashes = {item.type_hash for item in endpoints}
    if len(hashes) > len(_types(endpoints)):
        out.note("the type's hash differs between nodes: they were built from different definitions (see -v)")
    for kind, title in (("MP", "Publisher count"), ("MS", "Subscription count")):
        own = [item for item in endpoints if item.kind == kind]
        out.line(f"{'' if not verbose else chr(10)}{title}: {len(own)}")
        for item in own if verbose else ():
            _print_endpoint(out, _endpoint(item))


def _print_endpoint(out: Output, item: dict[str, Any]) -> None:
    qos = item["qos"]
    depth = f" ({qos['depth']})" if qos["history"] == "KEEP_LAST" else ""
    rows = (
        ("Node", f"{item['namespace'].rstrip('/')}/{item['node']}"),
        ("Type", item["type"]),
        ("Type hash", item["type_hash"]),
        ("GID", item["gid"]),
        ("QoS", f"{qos['reliability']}, {qos['durability']}, {qos['history']}{depth}"),
    )
    out.line()
    for label, value in rows:
        out.line(f"  {out.style(label.ljust(9), '2')}  {value}")
