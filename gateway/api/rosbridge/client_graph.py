"""The ROS graph as one client sees it: topics, services, actions and nodes of its robots, under its names for them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from gateway.api.visitor import Place, Visitor
from gateway.fleet.graph import Endpoint, RobotGraph

__all__ = ["World"]


class World:
    """Looks only. Lists are sorted by name."""

    def __init__(self, visitor: Visitor) -> None:
        self._visitor = visitor

    def topics(self) -> list[tuple[str, str]]:
        """(name, type) of every topic that a robot announced, or that its graph has."""
        found: dict[str, str] = {}
        for robot, graph in self._graphs():
            for table in (graph.subscribers, graph.publishers):
                for topic, endpoints in table.items():
                    if endpoints:
                        found[self._shown(robot, topic)] = endpoints[0].type_name
        found.update({topic.shown: topic.channel.schema_name for topic in self._visitor.topics()})
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
        return self._ends(topic, lambda graph: graph.publishers)

    def subscribers(self, topic: str) -> list[str]:
        """The nodes that subscribe to a topic."""
        return self._ends(topic, lambda graph: graph.subscribers)

    def providers(self, service: str) -> list[str]:
        """The nodes that serve a service."""
        place = self._visitor.find_service(service)
        info = self._graph(place).services.get(place.name)
        return sorted(self._shown(place.robot, node) for node in info.nodes if node) if info is not None else []

    def of_node(self, node: str) -> tuple[list[str], list[str], list[str]]:
        """(publishing, subscribing, services) of a node."""
        for place in self._visitor.places(node):
            graph, robot = self._graph(place), place.robot
            if place.name in graph.nodes:
                tables = (graph.publishers, graph.subscribers)
                publishing, subscribing = (
                    sorted(
                        self._shown(robot, topic)
                        for topic, ends in table.items()
                        if any(end.node == place.name for end in ends)
                    )
                    for table in tables
                )
                served = [name for name, info in graph.services.items() if place.name in info.nodes]
                return publishing, subscribing, sorted(self._shown(robot, name) for name in served)
        return [], [], []

    def parameter_nodes(self) -> list[tuple[str, Place]]:
        """(name, place) of every node that has parameters."""
        suffix = "/list_parameters"
        return sorted(
            (
                (self._shown(robot, name.removesuffix(suffix)), Place(robot, name.removesuffix(suffix)))
                for robot, graph in self._graphs()
                for name, info in graph.services.items()
                if name.endswith(suffix) and info.servers
            ),
            key=lambda item: item[0],
        )

    def _graphs(self) -> Iterator[tuple[str, RobotGraph]]:
        yield from ((graph.robot, graph) for graph in self._visitor.graphs())

    def _graph(self, place: Place) -> RobotGraph:
        return self._visitor.services.graphs.of(place.robot)

    def _shown(self, robot: str, name: str) -> str:
        return self._visitor.names.shown(robot, name)

    def _ends(self, topic: str, table: Callable[[RobotGraph], Mapping[str, Sequence[Endpoint]]]) -> list[str]:
        found = [
            self._shown(place.robot, end.node)
            for place in self._visitor.places(topic)
            for end in table(self._graph(place)).get(place.name, ())
            if end.node
        ]
        return sorted(set(found))
