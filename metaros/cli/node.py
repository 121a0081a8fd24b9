"""`metaros node`: who is in the graph, and what they publish, read, serve and call."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.visit import Visit, visiting

if TYPE_CHECKING:
    from metaros.cli.output import Output

__all__ = ["register"]

group = typer.Typer(name="node", no_args_is_help=True, help="Nodes: list them, look at one.")
SECTIONS = (
    ("MS", "Subscribers", "subscribers"),
    ("MP", "Publishers", "publishers"),
    ("SS", "Service Servers", "service_servers"),
    ("SC", "Service Clients", "service_clients"),
)
ACTION_SECTIONS = (("sources", "Action Servers", "action_servers"), ("sinks", "Action Clients", "action_clients"))


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
@visiting
def list_(
    at: Visit, count: Annotated[bool, typer.Option("--count-nodes", "-c", help="Only how many.")] = False
) -> None:
    """List the nodes of the graph."""
    out = at.out
    with at.look() as graph:
        nodes = sorted(graph.nodes(), key=lambda node: node.full_name)
    names = [node.full_name for node in nodes]
    if count:
        out.line(str(len(names)))
    elif out.json:
        out.objects([{"name": node.full_name, "namespace": node.namespace, "zid": node.zid} for node in nodes])
    else:
        for name in names:
            out.line(name)
        if not names:
            out.note("no nodes: start one, or `metaros up`")
        _warn_twins(names, out)


def _warn_twins(names: list[str], out: Output) -> None:
    twins = sorted({name for name in names if names.count(name) > 1})
    if twins:
        out.note(f"several nodes have the same name: {', '.join(twins)}")


@group.command("info")
@visiting
def info(
    at: Visit,
    node: Annotated[str, typer.Argument(metavar="NODE", help="Such as /sim_1/base.")],
    hidden: Annotated[bool, typer.Option("--include-hidden", help="Also the topics and services of actions.")] = False,
) -> None:
    """Show a node's publishers, subscribers, services, clients and actions."""
    from metaros.cli.connection import absolute
    from metaros.cli.graph_model import draw
    from metaros.cli.names import is_hidden, no_such

    out = at.out
    name = absolute(node)
    with at.look() as graph:
        known = {item.full_name for item in graph.nodes()}
        endpoints = graph.endpoints()
        actions = [link for link in draw([], graph.tokens()).links if link.kind == "action"]
    if name not in known:
        raise no_such("node", name, known)
    own = [item for item in endpoints if item.node_full_name == name and (hidden or not is_hidden(item.topic))]
    sections = {(title, key): _rows(own, kind) for kind, title, key in SECTIONS}
    for side, title, key in ACTION_SECTIONS:
        ours = [link for link in actions if name in getattr(link, side)]
        sections[title, key] = [{"name": link.name, "type": " or ".join(link.types)} for link in ours]
    if out.json:
        out.objects({"name": name, **{key: rows for (_, key), rows in sections.items()}})
        return
    out.line(out.style(name, "1"))
    for (title, _), rows in sections.items():
        out.line(out.style(f"  {title}:", "1"))
        for row in rows:
            out.line(f"    {out.style(row['name'], '36')}: {row['type']}")


def _rows(endpoints: Iterable[Any], kind: str) -> list[dict[str, str]]:
    pairs = sorted({(item.topic, item.type_name) for item in endpoints if item.kind == kind})
    return [{"name": topic, "type": type_name} for topic, type_name in pairs]
