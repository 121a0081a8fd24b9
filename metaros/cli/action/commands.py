"""`metaros action`: list actions, look at one, find those of a type, send a goal. The grammar is ros2's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from metaros.cli.action import goal
from metaros.cli.graph_target.target import GraphTarget, graph_command

if TYPE_CHECKING:
    from metaros.cli.graph.model import Link
    from metaros.cli.remote.graph import RemoteGraph
    from metaros.wire import Graph

__all__ = ["register"]

group = typer.Typer(name="action", no_args_is_help=True, help="Actions: list, look, send goals.")
ActionArgument = Annotated[str, typer.Argument(metavar="ACTION", help="Such as /fibonacci.")]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
@graph_command
def list_(
    target: GraphTarget,
    show_types: Annotated[bool, typer.Option("--show-types", "-t", help="Show each action's type.")] = False,
    count: Annotated[bool, typer.Option("--count-actions", "-c", help="Only how many.")] = False,
) -> None:
    """List the actions of the graph."""
    out = target.out
    with target.open_graph() as graph:
        found = _actions(graph)
    if count:
        out.line(str(len(found)))
    elif out.json:
        out.objects([_facts(link) for link in found.values()])
    else:
        for name, link in found.items():
            out.line(f"{name} [{', '.join(link.types)}]" if show_types else name)
        if not found:
            out.note("no actions: start a node that serves one")


@group.command("type")
@graph_command
def type_(target: GraphTarget, action: ActionArgument) -> None:
    """Print an action's type."""
    target.out.names(_one(action, target).types)


@group.command("find")
@graph_command
def find(
    target: GraphTarget,
    type_name: Annotated[str, typer.Argument(metavar="TYPE", help="Such as example_interfaces/action/Fibonacci.")],
    count: Annotated[bool, typer.Option("--count-actions", "-c", help="Only how many.")] = False,
) -> None:
    """List the actions of a type."""
    from metaros.cli.shared.names import known_type

    with target.open_graph() as graph:
        found = _actions(graph)
    full = known_type(type_name, "action", {item for link in found.values() for item in link.types})
    target.out.names([name for name, link in found.items() if full in link.types], count=count)


@group.command("info")
@graph_command
def info(
    target: GraphTarget,
    action: ActionArgument,
    count: Annotated[bool, typer.Option("--count", "-c", help="Only how many there are.")] = False,
) -> None:
    """Show an action's type, servers and clients, and what keeps them apart."""
    out, link = target.out, _one(action, target)
    if out.json:
        out.objects(_facts(link))
        return
    out.line(f"Action: {out.style(link.name, '1')}")
    out.line(f"Type: {' or '.join(link.types)}")
    for title, nodes in (("Action clients", link.sinks), ("Action servers", link.sources)):
        out.line(f"{title}: {len(nodes)}")
        for node in () if count else nodes:
            out.line(f"    {node}")
    for fault in link.faults:
        out.note(f"{fault.source} and {fault.sink} do not fit together: {fault.text}")


group.command("send_goal")(goal.send_goal)


def _actions(graph: Graph | RemoteGraph) -> dict[str, Link]:
    """By name; each with its servers as sources and its clients as sinks."""
    from metaros.cli.graph.model import build_graph_model

    return {link.name: link for link in build_graph_model([], graph.tokens()).links if link.kind == "action"}


def _one(action: str, target: GraphTarget) -> Link:
    from metaros.cli.shared.names import no_such

    name = target.absolute(action)
    with target.open_graph() as graph:
        found = _actions(graph)
    if name not in found:
        raise no_such("action", name, found)
    return found[name]


def _facts(link: Link) -> dict[str, object]:
    return {"action": link.name, "types": link.types, "servers": link.sources, "clients": link.sinks}
