"""`metaros param`: a node's parameters: list, get, set, describe, dump, load and delete them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.graph_target.target import GraphTarget, graph_command

if TYPE_CHECKING:
    from metaros.node.parameters import ParameterClient

__all__ = ["register"]

group = typer.Typer(name="param", no_args_is_help=True, help="Parameters of nodes.")

NodeName = Annotated[str, typer.Argument(metavar="NODE", help="Such as /sim_1/base.")]
ParamName = Annotated[str, typer.Argument(metavar="NAME", help="The parameter, such as max_speed.")]
Timeout = Annotated[
    float, typer.Option("--timeout", min=0.1, metavar="SECONDS", help="How long to wait for the node's answer.")
]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("list")
@graph_command
def list_(
    target: GraphTarget,
    node: Annotated[str, typer.Argument(metavar="NODE", help="All nodes if left out.")] = "",
    name_filter: Annotated[
        str, typer.Option("--filter", metavar="REGEX", help="Only names in which this is found.")
    ] = "",
    show_type: Annotated[bool, typer.Option("--param-type", help="Show each parameter's type.")] = False,
    timeout: Timeout = 5.0,
) -> None:
    """List the parameters of a node, or of all nodes."""
    from metaros.cli.param.view import matching, parameter_nodes, rows
    from metaros.errors import PeerError

    out = target.out
    found: list[dict[str, Any]] = []
    with _asking(node, target) as (own, node_name):
        for name in [node_name] if node_name else parameter_nodes(own.graph):
            client = own.create_parameter_client(name)
            try:
                names = matching(client.list(timeout_s=timeout), name_filter)
                types = client.types(names, timeout_s=timeout) if show_type or out.json else {}
            except PeerError as error:
                if node_name:
                    raise
                out.note(f"{name}: {error}")
                continue
            found.append({"node": name, "parameters": rows(names, types)})
    if out.json:
        out.objects(found[0] if node_name else found)
        return
    for entry in found:
        if not node_name:
            out.line(f"{entry['node']}:")
        for row in entry["parameters"]:
            shown = f"{row['name']} (type: {row['type']})" if show_type else row["name"]
            out.line(shown if node_name else f"  {shown}")
    if not found:
        out.note("no node has parameters: start one, or `metaros up`")


@group.command("get")
@graph_command
def get(
    target: GraphTarget,
    node: NodeName,
    name: ParamName,
    hide_type: Annotated[bool, typer.Option("--hide-type", help="Only the value.")] = False,
    timeout: Timeout = 5.0,
) -> None:
    """Print a parameter's value."""
    from metaros.cli.param.view import json_value, require, shown, value_words
    from metaros.node.parameters.values import ParameterType

    out = target.out
    with _remote(node, target) as client:
        kind = client.types([name], timeout_s=timeout)[name]
        if kind is ParameterType.NOT_SET:
            require(client, name, timeout_s=timeout)
        value = client.get([name], timeout_s=timeout)[name]
    if out.json:
        out.objects({"name": name, "type": kind.label, "value": json_value(value)})
    else:
        out.line(shown(value) if hide_type else f"{value_words(kind)} {shown(value)}".rstrip())


@group.command("set", context_settings={"ignore_unknown_options": True})
@graph_command
def set_(
    target: GraphTarget,
    node: NodeName,
    name: ParamName,
    value: Annotated[str, typer.Argument(metavar="VALUE", help="YAML, read as the parameter's type.")],
    timeout: Timeout = 5.0,
) -> None:
    """Set a parameter."""
    from metaros.cli.param.view import done, json_value, require
    from metaros.errors import ParameterError
    from metaros.node.parameters.files import parse_value
    from metaros.node.parameters.values import ParameterType, convert

    out = target.out
    with _remote(node, target) as client:
        rules = require(client, name, timeout_s=timeout)
        kind = ParameterType.NOT_SET if rules is None or rules.dynamic_typing else rules.kind
        try:
            wanted = convert(value, kind, parse_value)
        except ParameterError as error:
            raise ParameterError(f"{name}: {error}") from None
        done(client.set({name: wanted}, timeout_s=timeout)[name], "set", name)
    if out.json:
        out.objects({"name": name, "value": json_value(wanted)})
    else:
        out.line("Set parameter successful")


@group.command("describe")
@graph_command
def describe(
    target: GraphTarget,
    node: NodeName,
    names: Annotated[list[str], typer.Argument(metavar="NAME...", help="The parameters.")],
    timeout: Timeout = 5.0,
) -> None:
    """Show the type, the description and the rules of parameters."""
    from metaros.cli.param.view import rule_lines, rule_object, unknown

    out = target.out
    with _remote(node, target) as client:
        found = client.describe(names, timeout_s=timeout)
        missing = [name for name in names if name not in found]
        if missing:
            raise unknown(client, missing[0], timeout_s=timeout)
    if out.json:
        out.objects([rule_object(found[name]) for name in names])
        return
    for name in names:
        for line in rule_lines(found[name]):
            out.line(line)


@group.command("dump")
@graph_command
def dump(
    target: GraphTarget,
    node: NodeName,
    timeout: Timeout = 5.0,
) -> None:
    """Print all parameters of a node as a ROS 2 parameter file."""
    from metaros.cli.param.view import json_value
    from metaros.node.parameters.files import dump_yaml

    out = target.out
    with _remote(node, target) as client:
        values = client.dump(timeout_s=timeout)
        node_name = client.target
    if out.json:
        out.objects({name: json_value(value) for name, value in values.items()})
    else:
        out.line(dump_yaml(node_name, values).rstrip("\n"))


@group.command("load")
@graph_command
def load(
    target: GraphTarget,
    node: NodeName,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A ROS 2 parameter file.")],
    no_use_wildcard: Annotated[
        bool, typer.Option("--no-use-wildcard", help="Leave out what the file says of /** and the like.")
    ] = False,
    timeout: Timeout = 5.0,
) -> None:
    """Set a node's parameters from a ROS 2 parameter file, each for itself."""
    from metaros.cli.param.view import fitted
    from metaros.errors import PeerError, UsageError
    from metaros.node.parameters.files import load_file

    out = target.out
    with _remote(node, target) as client:
        values = load_file(file, client.target, wildcards=not no_use_wildcard)
        if not values:
            raise UsageError(f"{file} has no parameters for {client.target}")
        results = client.set(fitted(client, values, timeout_s=timeout), timeout_s=timeout)
    if out.json:
        out.objects([{"name": n, "successful": r.successful, "reason": r.reason} for n, r in results.items()])
    else:
        for name, result in results.items():
            out.line(f"Set parameter {name} {'successful' if result else f'failed: {result.reason}'}")
    failed = [name for name, result in results.items() if not result]
    if failed:
        raise PeerError(f"{len(failed)} of {len(results)} parameters were refused: {', '.join(failed)}")


@group.command("delete")
@graph_command
def delete(
    target: GraphTarget,
    node: NodeName,
    name: ParamName,
    timeout: Timeout = 5.0,
) -> None:
    """Delete a parameter that is dynamically typed."""
    from metaros.cli.param.view import done, require

    out = target.out
    with _remote(node, target) as client:
        require(client, name, timeout_s=timeout)
        done(client.set({name: None}, timeout_s=timeout)[name], "delete", name)
    if out.json:
        out.objects({"name": name, "deleted": True})
    else:
        out.line("Deleted parameter successfully")


@contextmanager
def _asking(node: str, target: GraphTarget) -> Iterator[tuple[Any, str]]:
    """A short-lived node of ours, and the full name of the node that is meant; it must offer parameters."""
    from metaros.cli.param.view import check_node

    node_name = target.absolute(node) if node else ""
    with target.node() as own:
        if node_name:
            check_node(own.graph, node_name)
        yield own, node_name


@contextmanager
def _remote(node: str, target: GraphTarget) -> Iterator[ParameterClient]:
    with _asking(node, target) as (own, node_name):
        yield own.create_parameter_client(node_name)
