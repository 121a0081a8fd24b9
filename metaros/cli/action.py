"""`metaros action`: list actions, look at one, find those of a type, send a goal. The grammar is ros2's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from metaros.cli import action_goal
from metaros.cli.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, SpinTime, ZenohPort

if TYPE_CHECKING:
    from metaros.cli.graph_model import Link
    from metaros.wire import Graph

__all__ = ["register"]

group = typer.Typer(name="action", no_args_is_help=True, help="Actions: list, look, send goals.")
ActionArgument = Annotated[str, typer.Argument(metavar="ACTION", help="Such as /fibonacci.")]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
def list_(
    show_types: Annotated[bool, typer.Option("--show-types", "-t", help="Show each action's type.")] = False,
    count: Annotated[bool, typer.Option("--count-actions", "-c", help="Only how many.")] = False,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    spin_time: SpinTime = 1.0,
    output: FormatOption = Format.TEXT,
) -> None:
    """List the actions of the graph."""
    from metaros.cli.connection import look
    from metaros.cli.output import Output

    out = Output(output)
    with look(zenoh_port, domain, spin_time=spin_time) as graph:
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
def type_(
    action: ActionArgument,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    spin_time: SpinTime = 1.0,
    output: FormatOption = Format.TEXT,
) -> None:
    """Print an action's type."""
    from metaros.cli.output import Output

    Output(output).names(_one(action, zenoh_port, domain, spin_time).types)


@group.command("find")
def find(
    type_name: Annotated[str, typer.Argument(metavar="TYPE", help="Such as example_interfaces/action/Fibonacci.")],
    count: Annotated[bool, typer.Option("--count-actions", "-c", help="Only how many.")] = False,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    spin_time: SpinTime = 1.0,
    output: FormatOption = Format.TEXT,
) -> None:
    """List the actions of a type."""
    from metaros.cli.connection import look
    from metaros.cli.names import known_type
    from metaros.cli.output import Output

    with look(zenoh_port, domain, spin_time=spin_time) as graph:
        found = _actions(graph)
    full = known_type(type_name, "action", {item for link in found.values() for item in link.types})
    Output(output).names([name for name, link in found.items() if full in link.types], count=count)


@group.command("info")
def info(
    action: ActionArgument,
    count: Annotated[bool, typer.Option("--count", "-c", help="Only how many there are.")] = False,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    spin_time: SpinTime = 1.0,
    output: FormatOption = Format.TEXT,
) -> None:
    """Show an action's type, servers and clients, and what keeps them apart."""
    from metaros.cli.output import Output

    out, link = Output(output), _one(action, zenoh_port, domain, spin_time)
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


group.command("send_goal")(action_goal.send_goal)


def _actions(graph: Graph) -> dict[str, Link]:
    """By name; each with its servers as sources and its clients as sinks."""
    from metaros.cli.graph_model import draw

    return {link.name: link for link in draw([], graph.tokens()).links if link.kind == "action"}


def _one(action: str, zenoh_port: int, domain: int, spin_time: float) -> Link:
    from metaros.cli.connection import absolute, look
    from metaros.cli.names import no_such

    name = absolute(action)
    with look(zenoh_port, domain, spin_time=spin_time) as graph:
        found = _actions(graph)
    if name not in found:
        raise no_such("action", name, found)
    return found[name]


def _facts(link: Link) -> dict[str, object]:
    return {"action": link.name, "types": link.types, "servers": link.sources, "clients": link.sinks}
