"""`metaros service`: list services, look at one, find those of a type, call one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.graph_target.target import GraphTarget, graph_command

if TYPE_CHECKING:
    from metaros.cli.remote.graph import RemoteGraph
    from metaros.wire import Graph

__all__ = ["register"]

group = typer.Typer(name="service", no_args_is_help=True, help="Services: list, look, find, call.")


ServiceArgument = Annotated[str, typer.Argument(metavar="SERVICE", help="Such as /sim_1/base/resume.")]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
@graph_command
def list_(
    target: GraphTarget,
    show_types: Annotated[bool, typer.Option("--show-types", "-t", help="Show each service's type.")] = False,
    count: Annotated[bool, typer.Option("--count-services", "-c", help="Only how many.")] = False,
    hidden: Annotated[bool, typer.Option("--include-hidden-services", help="Those of actions, too.")] = False,
) -> None:
    """List the services that a node serves."""
    from metaros.cli.shared.names import is_hidden

    out = target.out
    with target.open_graph() as graph:
        services = {name: types for name, types in _services(graph).items() if hidden or not is_hidden(name)}
    if count:
        out.line(str(len(services)))
    elif out.json:
        out.objects([{"service": name, "types": types} for name, types in services.items()])
    else:
        for name, types in services.items():
            out.line(f"{name} [{', '.join(types)}]" if show_types else name)
    if not services and not count:
        out.note("no services: start a node, or `metaros up`")


@group.command("type")
@graph_command
def type_(target: GraphTarget, service: ServiceArgument) -> None:
    """Print a service's type."""

    out, name = target.out, target.absolute(service)
    with target.open_graph() as graph:
        _type_of(graph, name, "")  # says what is wrong where nobody serves it
        types = _services(graph)[name]
    out.names(types)


@group.command("find")
@graph_command
def find(
    target: GraphTarget,
    type_name: Annotated[str, typer.Argument(metavar="TYPE", help="Such as std_srvs/srv/Trigger.")],
    count: Annotated[bool, typer.Option("--count-services", "-c", help="Only how many.")] = False,
) -> None:
    """List the services of a type."""
    from metaros.cli.shared.names import known_type

    out = target.out
    with target.open_graph() as graph:
        services = _services(graph)
    full = known_type(type_name, "srv", {item for types in services.values() for item in types})
    out.names([name for name, types in services.items() if full in types], count=count)


@group.command("info")
@graph_command
def info(
    target: GraphTarget,
    service: ServiceArgument,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Each server and client, with its hash.")] = False,
) -> None:
    """Show a service's type, servers and clients."""
    from metaros.cli.shared.endpoints import endpoint_facts, print_endpoints
    from metaros.cli.shared.names import no_such

    out, name = target.out, target.absolute(service)
    with target.open_graph() as graph:
        known, ends = graph.services(), [item for item in graph.endpoints(topic=name) if item.kind in ("SS", "SC")]
    if not ends:
        raise no_such("service", name, known)
    if out.json:
        facts = [endpoint_facts(item) for item in ends]
        out.objects({"service": name, "types": sorted({item.type_name for item in ends}), "endpoints": facts})
        return
    print_endpoints(out, ends, (("SS", "Services count"), ("SC", "Clients count")), verbose=verbose)


@group.command("call")
@graph_command
def call(
    target: GraphTarget,
    service: ServiceArgument,
    type_or_values: Annotated[str, typer.Argument(metavar="TYPE", help="Taken from the graph if left out.")] = "",
    values: Annotated[str, typer.Argument(metavar="YAML", help="The request's fields.")] = "",
    timeout: Annotated[
        float, typer.Option("--timeout", min=0.1, metavar="SECONDS", help="How long to wait for the response.")
    ] = 10.0,
) -> None:
    """Call a service and print its response."""
    from metaros.cli.shared.render import message_yaml, plain
    from metaros.cli.shared.types import parse_values
    from metaros.errors import TimeoutError_
    from metaros.idl.json import from_json

    out = target.out
    name = target.absolute(service)
    if type_or_values.lstrip().startswith("{"):  # the type was left out
        type_or_values, values = "", type_or_values
    with target.node() as node:
        full = _type_of(node.graph, name, type_or_values)
        hashes = [end.type_hash for end in node.graph.endpoints(name, "SS") if end.type_name == full]
        kind: Any = node.fetch_interface(full, hashes[0], timeout_s=timeout)
        catalogue = kind.Request.__metaros_catalogue__
        request = from_json(kind.Request, parse_values(values, f"{full}_Request", catalogue))
        client = node.create_client(kind, name)
        if not client.wait_for_service(min(timeout, max(target.spin_time, 0.1))):
            raise TimeoutError_(f"{name} does not answer: its node may have stopped")
        response = client.call(request, timeout_s=timeout)
    if out.json:
        out.objects(plain(response))
    else:
        out.line(message_yaml(response))


def _services(graph: Graph | RemoteGraph) -> dict[str, list[str]]:
    found: dict[str, set[str]] = {}
    for item in graph.endpoints(kind="SS"):
        found.setdefault(item.topic, set()).add(item.type_name)
    return {name: sorted(types) for name, types in sorted(found.items())}


def _type_of(graph: Graph | RemoteGraph, name: str, typed: str) -> str:
    """The type that the service's server declares; UnavailableError where there is none."""
    from metaros.cli.shared.names import no_such
    from metaros.cli.shared.types import type_in_use

    services = _services(graph)
    if name not in services:
        raise no_such("service", name, services)
    return type_in_use(name, typed, "srv", services[name])
