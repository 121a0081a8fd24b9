"""A snapshot of this robot's part of the ROS graph: its nodes, their endpoints, who else uses its names. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

from edge_agent.forwarding.scope import Scope
from metaros._proto import link_pb2
from metaros.wire import EndpointInfo
from metaros.wire.graph import NodeInfo

__all__ = ["GraphEndpoint", "GraphSnapshot", "take_snapshot"]

KINDS: Final = {
    "MP": link_pb2.ENDPOINT_KIND_PUBLISHER,
    "MS": link_pb2.ENDPOINT_KIND_SUBSCRIPTION,
    "SS": link_pb2.ENDPOINT_KIND_SERVER,
    "SC": link_pb2.ENDPOINT_KIND_CLIENT,
}


class GraphEndpoint(NamedTuple):
    """An endpoint as it is reported to the gateway."""

    kind: int
    node: str
    name: str
    type_name: str
    type_hash: str
    qos: str


class GraphSnapshot(NamedTuple):
    """All of it at one moment; endpoints by their GIDs."""

    nodes: frozenset[str]
    endpoints: dict[bytes, GraphEndpoint]


def take_snapshot(
    nodes: Iterable[NodeInfo],
    endpoints: Iterable[EndpointInfo],
    scope: Scope,
    *,
    own: tuple[str, str],
    shows: Callable[[EndpointInfo], bool],
) -> GraphSnapshot:
    """Look at the graph. `own` is (zid, full name) of the agent's node, of which only what `shows` allows counts.

    A node of another robot that uses a name of this one is reported without its own name.
    """
    mine = frozenset(node.full_name for node in nodes if scope.includes(node.full_name))
    found: dict[bytes, GraphEndpoint] = {}
    for info in endpoints:
        owner = info.node_full_name
        ours = scope.includes(owner)
        if info.topic.startswith("/_") or not (ours or scope.includes(info.topic)):
            continue
        if (info.zid, owner) == own and not shows(info):
            continue
        node = owner if ours else ""
        found[info.gid] = GraphEndpoint(
            KINDS[info.kind], node, info.topic, info.type_name, info.type_hash, info.qos_text
        )
    return GraphSnapshot(mine, found)
