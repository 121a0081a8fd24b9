"""The ROS graph as one client sees it: topics, services, actions and nodes of its robots, under its names for them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from gateway.api.robot_access import ResolvedName, RobotAccess
from gateway.fleet.ros.graph import Endpoint, RobotGraph

__all__ = ["ClientGraph"]


class ClientGraph:
    """Read-only. Lists are sorted by name."""

    def __init__(self, access: RobotAccess) -> None:
        self._access = access

    def topics(self) -> list[tuple[str, str]]:
        """(name, type) of every topic that a robot announced, or that its graph has."""
        found: dict[str, str] = {}
        for robot, graph in self._graphs():
            for table in (graph.subscribers, graph.publishers):
                for topic, endpoints in table.items():
                    if endpoints:
                        found[self._shown(robot, topic)] = endpoints[0].type_name
        found.update({topic.shown: topic.channel.schema_name for topic in self._access.topics()})
        return sorted(found.items())

    def services(self) -> list[tuple[str, str]]:
        """(name, type) of every service that somebody serves."""
        return sorted(
            (self._shown(robot, name), info.type_name)
            for robot, graph in self._graphs()
            for name, info in graph.services.items()
            if info.servers
        )

    def actions(self) -> list[tuple[str, str]]:
        """(name, type) of every action that somebody serves."""
        return sorted(
            (self._shown(robot, name), info.type_name)
            for robot, graph in self._graphs()
            for name, info in graph.actions.items()
            if info.servers
        )

    def nodes(self) -> list[str]:
        """The nodes' full names."""
        return sorted(self._shown(robot, node) for robot, graph in self._graphs() for node in graph.nodes)

    def publishers(self, topic: str) -> list[str]:
        """The nodes that publish a topic."""
        return self._nodes(topic, lambda graph: graph.publishers)

    def subscribers(self, topic: str) -> list[str]:
        """The nodes that subscribe to a topic."""
        return self._nodes(topic, lambda graph: graph.subscribers)

    def providers(self, service: str) -> list[str]:
        """The nodes that serve a service."""
        resolved = self._access.find_service(service)
        info = self._graph(resolved).services.get(resolved.name)
        return sorted(self._shown(resolved.robot, node) for node in info.nodes if node) if info is not None else []

    def of_node(self, node: str) -> tuple[list[str], list[str], list[str]]:
        """(publishing, subscribing, services) of a node."""
        for resolved in self._access.candidates(node):
            graph, robot = self._graph(resolved), resolved.robot
            if resolved.name in graph.nodes:
                tables = (graph.publishers, graph.subscribers)
                publishing, subscribing = (
                    sorted(
                        self._shown(robot, topic)
                        for topic, ends in table.items()
                        if any(end.node == resolved.name for end in ends)
                    )
                    for table in tables
                )
                served = [name for name, info in graph.services.items() if resolved.name in info.nodes]
                return publishing, subscribing, sorted(self._shown(robot, name) for name in served)
        return [], [], []

    def parameter_nodes(self) -> list[tuple[str, ResolvedName]]:
        """(name, resolved name) of every node that has parameters."""
        suffix = "/list_parameters"
        return sorted(
            (
                (self._shown(robot, name.removesuffix(suffix)), ResolvedName(robot, name.removesuffix(suffix)))
                for robot, graph in self._graphs()
                for name, info in graph.services.items()
                if name.endswith(suffix) and info.servers
            ),
            key=lambda item: item[0],
        )

    def _graphs(self) -> Iterator[tuple[str, RobotGraph]]:
        yield from ((graph.robot, graph) for graph in self._access.graphs())

    def _graph(self, resolved: ResolvedName) -> RobotGraph:
        return self._access.services.graphs.of(resolved.robot)

    def _shown(self, robot: str, name: str) -> str:
        return self._access.names.shown(robot, name)

    def _nodes(self, topic: str, table: Callable[[RobotGraph], Mapping[str, Sequence[Endpoint]]]) -> list[str]:
        found = [
            self._shown(resolved.robot, end.node)
            for resolved in self._access.candidates(topic)
            for end in table(self._graph(resolved)).get(resolved.name, ())
            if end.node
        ]
        return sorted(set(found))
