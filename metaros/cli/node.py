"""`metaros node`: who is in the graph, and what they publish, read, serve and call.

With `--robot R`, or `-l TERMS` for a group, the same words are about the nodes that robots' supervisors run, by a
gateway; those verbs come from the gateway's half by an entry point, as nothing here knows a gateway.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.graph_target.target import GraphTarget, graph_command
from metaros.cli.shared.watch import WatchOption
from metaros.errors import UsageError

if TYPE_CHECKING:
    from metaros.cli.shared.output import Output

__all__ = ["register"]

group = typer.Typer(name="node", no_args_is_help=True, help="Nodes of this graph, or of robots anywhere.")
SECTIONS = (
    ("MS", "Subscribers", "subscribers"),
    ("MP", "Publishers", "publishers"),
    ("SS", "Service Servers", "service_servers"),
    ("SC", "Service Clients", "service_clients"),
)
ACTION_SECTIONS = (("sources", "Action Servers", "action_servers"), ("sinks", "Action Clients", "action_clients"))


REMOTE_GROUP = "metaros.cli.remote"  # the group of entry points: modules that know a gateway

Robot = Annotated[str, typer.Option("--robot", "-r", metavar="ROBOT", help="Of this robot, by a gateway.")]
Selector = Annotated[
    str, typer.Option("--selector", "-l", metavar="TERMS", help="Of each robot named, by a gateway: label=value.")
]
Gateway = Annotated[
    str,
    typer.Option(
        "--gateway", metavar="URL", envvar="METAROS_GATEWAY_URL", show_envvar=False, help="That gateway's address."
    ),
]


def register(app: typer.Typer) -> None:
    """Add the noun, with the verbs for remote robots where a package provides them."""
    if (far := remote_commands()) is not None:
        far.register(group)
    app.add_typer(group)


@cache
def remote_commands() -> Any:
    """The commands for remote robots, which the gateway's package provides; None where it is not installed."""
    found = next(iter(entry_points(group=REMOTE_GROUP, name="node")), None)
    return found.load() if found is not None else None


def _remote_commands() -> Any:
    if (far := remote_commands()) is None:
        raise UsageError("robots are asked by a gateway: install metaros[gateway]")
    return far


@group.command("list")
@graph_command
def list_(
    target: GraphTarget,
    count: Annotated[bool, typer.Option("--count-nodes", "-c", help="Only how many.")] = False,
    robot: Robot = "",
    selector: Selector = "",
    state: Annotated[str, typer.Option("--state", metavar="STATE", help="With --robot: only these, as running.")] = "",
    again: WatchOption = False,
    ros: Annotated[bool, typer.Option("--ros", help="With --robot: the nodes of its ROS graph.")] = False,
    gateway: Gateway = "",
) -> None:
    """List the nodes of the graph, or those that robots run."""
    out = target.out
    if (robot and not ros) or selector:
        _remote_commands().list_nodes(out, robot=robot, selector=selector, state=state, gateway=gateway, again=again)
        return
    with target.open_graph() as graph:
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
@graph_command
def info(
    target: GraphTarget,
    node: Annotated[str, typer.Argument(metavar="NODE", help="Such as /sim_1/base.")],
    hidden: Annotated[bool, typer.Option("--include-hidden", help="Also the topics and services of actions.")] = False,
    robot: Robot = "",
    gateway: Gateway = "",
) -> None:
    """Show a node's publishers, subscribers, services, clients and actions; of a robot's node, how it does."""
    from metaros.cli.graph.model import build_graph_model
    from metaros.cli.shared.names import is_hidden, no_such

    out = target.out
    if robot and not node.startswith("/"):
        _remote_commands().show_node(out, node, robot=robot, gateway=gateway)
        return
    name = target.absolute(node)
    with target.open_graph() as graph:
        known = {item.full_name for item in graph.nodes()}
        endpoints = graph.endpoints()
        actions = [link for link in build_graph_model([], graph.tokens()).links if link.kind == "action"]
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
