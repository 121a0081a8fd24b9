"""What `metaros param` prints and what it looks up: names, values and rules in ros2's words, hints for typos."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from metaros.cli.shared.connection import closest
from metaros.errors import ParameterError, PeerError, UnavailableError, UnknownParameterError, UsageError
from metaros.node.parameters import ParameterClient, ParameterDescriptor, SetResult
from metaros.node.parameters.values import ParameterType, Value, fit
from metaros.wire import Graph

if TYPE_CHECKING:
    from metaros.cli.remote.graph import RemoteGraph

__all__ = [
    "check_node",
    "done",
    "fitted",
    "json_value",
    "matching",
    "parameter_nodes",
    "require",
    "rows",
    "rule_lines",
    "rule_object",
    "shown",
    "unknown",
    "value_words",
]

_LIST: Final = "rcl_interfaces/srv/ListParameters"
_WORDS: Final = {
    ParameterType.NOT_SET: "Parameter not set.",
    ParameterType.BOOL: "Boolean value is:",
    ParameterType.INTEGER: "Integer value is:",
    ParameterType.DOUBLE: "Double value is:",
    ParameterType.STRING: "String value is:",
    ParameterType.BYTE_ARRAY: "Byte values are:",
    ParameterType.BOOL_ARRAY: "Boolean values are:",
    ParameterType.INTEGER_ARRAY: "Integer values are:",
    ParameterType.DOUBLE_ARRAY: "Double values are:",
    ParameterType.STRING_ARRAY: "String values are:",
}


def parameter_nodes(graph: Graph | RemoteGraph) -> list[str]:
    """The nodes that offer parameters."""
    return sorted({end.node_full_name for end in graph.endpoints(kind="SS") if end.type_name == _LIST})


def check_node(graph: Graph | RemoteGraph, name: str) -> None:
    """UnavailableError with a hint where there is no such node, or where it offers no parameters."""
    if name in parameter_nodes(graph):
        return
    if name in {node.full_name for node in graph.nodes()}:
        raise UnavailableError(f"{name} offers no parameters")
    hint = closest(name, parameter_nodes(graph)) or "`metaros param list` shows the nodes that have parameters"
    raise UnavailableError(f"no node {name!r} in the graph\n{hint}")


def matching(names: Sequence[str], pattern: str) -> list[str]:
    """Sorted, and only those in which the regular expression is found."""
    try:
        wanted = re.compile(pattern)
    except re.error as error:
        raise UsageError(f"--filter {pattern!r} is no regular expression: {error}") from None
    return sorted(name for name in names if wanted.search(name))


def rows(names: Sequence[str], types: Mapping[str, ParameterType]) -> list[dict[str, str]]:
    """Names, with types where they are known."""
    return [{"name": name, **({"type": types[name].label} if name in types else {})} for name in names]


def value_words(kind: ParameterType) -> str:
    """What ros2 says before a value."""
    return _WORDS[kind]


def shown(value: Value) -> str:
    """The value as ros2 prints it."""
    if isinstance(value, bytes):
        return str([bytes([byte]) for byte in value])
    return "" if value is None else str(value)


def json_value(value: Value) -> Any:
    """The value for a JSON document: bytes become numbers, and what is no finite number null."""
    if isinstance(value, bytes | list):
        return [json_value(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def require(client: ParameterClient, name: str, *, timeout_s: float) -> ParameterDescriptor | None:
    """The rules of a parameter; UnknownParameterError with a hint where the node has none of that name.

    None where the node takes names that were never declared.
    """
    found = client.describe([name], timeout_s=timeout_s).get(name)
    if found is None and name not in client.list(timeout_s=timeout_s):
        raise unknown(client, name, timeout_s=timeout_s)
    return found


def unknown(client: ParameterClient, name: str, *, timeout_s: float) -> UnknownParameterError:
    """That the node has no such parameter, and what it may be called."""
    names = client.list(timeout_s=timeout_s)
    hint = closest(name, names) or f"`metaros param list {client.target}` shows its parameters"
    return UnknownParameterError(f"{client.target} has no parameter {name!r}\n{hint}")


def done(result: SetResult, verb: str, name: str) -> None:
    """PeerError with the node's reason, unless it obeyed."""
    if not result:
        raise PeerError(f"the node refused to {verb} {name}: {result.reason.removeprefix(f'{name}: ')}")


def fitted(client: ParameterClient, values: Mapping[str, Any], *, timeout_s: float) -> dict[str, Any]:
    """Whole numbers of a file as doubles where the node's parameters are doubles."""
    kinds = {name: rules.kind for name, rules in client.describe(list(values), timeout_s=timeout_s).items()}
    return {name: _fitted(value, kinds.get(name, ParameterType.NOT_SET)) for name, value in values.items()}


def _fitted(value: Any, kind: ParameterType) -> Any:
    try:
        return fit(value, kind)
    except ParameterError:
        return value  # the node says what is wrong with it


def rule_lines(rules: ParameterDescriptor) -> Iterator[str]:
    """A parameter's rules as ros2 lays them out."""
    yield f"Parameter name: {rules.name}"
    yield f"  Type: {rules.kind.label}"
    if rules.description:
        yield f"  Description: {rules.description}"
    yield "  Constraints:"
    if rules.read_only:
        yield "    Read only: true"
    if rules.dynamic_typing:
        yield "    Dynamic typing: true"
    if rules.range is not None:
        yield f"    Min value: {rules.range.low}"
        yield f"    Max value: {rules.range.high}"
        if rules.range.step:
            yield f"    Step: {rules.range.step}"
    if rules.words:
        yield f"    Additional constraints: {rules.words}"


def rule_object(rules: ParameterDescriptor) -> dict[str, Any]:
    """The same for JSON."""
    bounds = rules.range
    ends = None if bounds is None else {"from": bounds.low, "to": bounds.high, "step": bounds.step}
    return {
        "name": rules.name,
        "type": rules.kind.label,
        "description": rules.description,
        "read_only": rules.read_only,
        "dynamic_typing": rules.dynamic_typing,
        "range": ends and {name: json_value(value) for name, value in ends.items()},
        "constraints": rules.words,
    }
