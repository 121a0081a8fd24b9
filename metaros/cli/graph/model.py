"""The model of a drawn graph: nodes, links between them, and mismatches of endpoints. Pure.

A link is a topic, a service, or an action, whose five endpoints (names with `/_action/`) are drawn as one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metaros.wire import EndpointToken

__all__ = ["Fault", "GraphModel", "Link", "LinkEndpoint", "build_graph_model", "restrict"]

ACTION = "/_action/"
# What every node has, and what nobody wants to see a hundred times.
USUAL_TOPICS = frozenset({"/rosout", "/parameter_events"})
USUAL_SERVICES = frozenset(
    {
        "describe_parameters",
        "get_logger_levels",
        "get_parameter_types",
        "get_parameters",
        "get_type_description",
        "list_parameters",
        "set_logger_levels",
        "set_parameters",
        "set_parameters_atomically",
    }
)


@dataclass(frozen=True, slots=True)
class Fault:
    """Why what `source` sends does not reach `sink`: `type_mismatch`, `type_hash_mismatch` or `qos_mismatch`."""

    code: str
    source: str
    sink: str
    text: str


@dataclass(frozen=True, slots=True)
class LinkEndpoint:
    """One endpoint of a link: whose it is, what it is (`publisher`, `subscription` …), and its QoS in words."""

    node: str
    role: str
    qos: str


@dataclass(frozen=True, slots=True)
class Link:
    """A topic with publishers and subscribers, a service or action with servers and clients."""

    kind: str
    name: str
    types: tuple[str, ...]
    sources: tuple[str, ...]
    sinks: tuple[str, ...]
    faults: tuple[Fault, ...] = ()
    ends: tuple[LinkEndpoint, ...] = ()

    def fault(self, source: str, sink: str) -> Fault | None:
        """What stands between two nodes, if anything."""
        return next((item for item in self.faults if (item.source, item.sink) == (source, sink)), None)

    def hears(self, node: str) -> bool:
        """Whether anybody gets through to `node`."""
        return node in self.sinks and not all(self.fault(source, node) for source in self.sources)


@dataclass(frozen=True, slots=True)
class GraphModel:
    """Nodes and links to draw."""

    nodes: tuple[str, ...]
    links: tuple[Link, ...]

    @property
    def faults(self) -> tuple[Fault, ...]:
        """All faults."""
        return tuple(fault for link in self.links for fault in link.faults)

    def without_idle_services(self) -> GraphModel:
        """The same without services that nobody calls: each node has some, and they link nothing."""
        return GraphModel(self.nodes, tuple(link for link in self.links if link.kind != "service" or link.sinks))


def build_graph_model(nodes: Iterable[str], tokens: Iterable[EndpointToken], *, everything: bool = False) -> GraphModel:
    """The picture of a graph; with `everything` also what each node has, and actions as their five endpoints."""
    names = set(nodes)
    groups: dict[tuple[str, str], list[EndpointToken]] = {}
    for token in tokens:
        names.add(token.node.full_name)
        kind, name = _link_of(token, everything)
        if everything or not _usual(kind, name):
            groups.setdefault((kind, name), []).append(token)
    order = {"topic": 0, "action": 1, "service": 2}
    keys = sorted(groups, key=lambda key: (order[key[0]], key[1]))
    return GraphModel(tuple(sorted(names)), tuple(_link(*key, groups[key]) for key in keys))


def restrict(picture: GraphModel, word: str) -> GraphModel:
    """Only the nodes and links whose name contains `word`, and what they are linked to."""
    links = tuple(
        link for link in picture.links if any(word in name for name in (link.name, *link.sources, *link.sinks))
    )
    ends = {name for link in links for name in (*link.sources, *link.sinks)}
    return GraphModel(tuple(name for name in picture.nodes if word in name or name in ends), links)


def _link_of(token: EndpointToken, everything: bool) -> tuple[str, str]:
    if not everything and ACTION in token.topic:
        return "action", token.topic.partition(ACTION)[0]
    return "topic" if token.kind in ("MP", "MS") else "service", token.topic


def _usual(kind: str, name: str) -> bool:
    if kind == "service":
        return name.rpartition("/")[2] in USUAL_SERVICES
    return kind == "topic" and name in USUAL_TOPICS


def _link(kind: str, name: str, tokens: list[EndpointToken]) -> Link:
    from metaros.cli.shared.endpoints import qos_words
    from metaros.wire.liveliness_tokens import ENDPOINT_KINDS

    if kind == "action":  # whoever has its service is an end of it; feedback flows the other way than goals
        ends = [token for token in tokens if token.kind in ("SS", "SC")] or tokens
        types = {_action_type(token.type_name) for token in ends if token.topic.endswith("/send_goal")}
    else:
        ends = tokens
        types = {token.type_name for token in tokens}
    sources = {token.node.full_name for token in ends if token.kind in ("MP", "SS")}
    sinks = {token.node.full_name for token in ends if token.kind in ("MS", "SC")}
    said = {LinkEndpoint(token.node.full_name, ENDPOINT_KINDS[token.kind], qos_words(token.qos)) for token in ends}
    return Link(
        kind,
        name,
        tuple(sorted(types)),
        tuple(sorted(sources)),
        tuple(sorted(sinks)),
        _faults(tokens),
        tuple(sorted(said, key=lambda end: (end.role, end.node, end.qos))),
    )


def _action_type(type_name: str) -> str:
    return type_name.removesuffix("_SendGoal")


def _faults(tokens: list[EndpointToken]) -> tuple[Fault, ...]:
    from metaros.wire.matching import mismatch

    found: dict[tuple[str, str, str], Fault] = {}
    for source in (token for token in tokens if token.kind in ("MP", "SS")):
        for sink in (token for token in tokens if token.kind in ("MS", "SC")):
            if (seen := mismatch(source, sink)) is not None:
                fault = Fault(seen.code, source.node.full_name, sink.node.full_name, _why(seen, source, sink))
                found.setdefault((fault.source, fault.sink, fault.code), fault)
    return tuple(found.values())


def _why(seen: Any, source: EndpointToken, sink: EndpointToken) -> str:
    """A fault in the words that fit beside an arrow."""
    from metaros.wire import incompatibilities

    if seen.code == "type_mismatch":
        return f"type {source.type_name} meets {sink.type_name}"
    if seen.code == "qos_mismatch":
        return "; ".join(incompatibilities(source.qos, sink.qos))
    return f"type hash {_short(source.type_hash)} meets {_short(sink.type_hash)}"


def _short(type_hash: str) -> str:
    return f"{type_hash[:15]}…" if len(type_hash) > 20 else type_hash
