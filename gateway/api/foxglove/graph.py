"""The connection graph as Foxglove draws it: who publishes, subscribes and serves what, by the client's names. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from gateway.api.foxglove.texts import GraphView
from gateway.domain.client_names import ClientNames
from gateway.fleet.ros.graph import Endpoint, RobotGraph

__all__ = ["graph_view"]

OUTSIDE = "(outside)"  # a node that is none of the robot's own


def graph_view(graphs: Iterable[RobotGraph], names: ClientNames) -> GraphView:
    """All those robots' graphs as one."""
    published: dict[str, list[str]] = {}
    subscribed: dict[str, list[str]] = {}
    services: dict[str, list[str]] = {}
    for graph in graphs:
        for found, ends in ((published, graph.publishers), (subscribed, graph.subscribers)):
            for topic, endpoints in ends.items():
                _add(found, graph.robot, topic, endpoints, names)
        for name, info in graph.services.items():
            _add(services, graph.robot, name, info.servers, names)
    return GraphView(published, subscribed, services)


def _add(found: dict[str, list[str]], robot: str, name: str, endpoints: Iterable[Endpoint], names: ClientNames) -> None:
    nodes = {names.shown(robot, end.node) if end.node else OUTSIDE for end in endpoints}
    if nodes:
        shown = names.shown(robot, name)
        found[shown] = sorted({*found.get(shown, ()), *nodes})
