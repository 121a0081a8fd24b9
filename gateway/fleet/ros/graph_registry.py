"""The graphs of all robots: accumulates the reports of their agents, and notifies watchers of changes."""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Callable, Iterable
from itertools import groupby
from types import MappingProxyType
from typing import Final

from gateway.fleet.ros.graph import ActionInfo, Endpoint, RobotGraph, ServiceInfo
from metaros._proto import link_pb2
from metaros.errors import MetarosError, TooLargeError
from metaros.idl import Catalogue, default_catalogue
from metaros.idl.catalogue import parse_definition
from metaros.idl.hashing import type_hash
from metaros.limits import LIMITS, Limits
from metaros.link.parse_cost import TYPE_STEPS, parse_cost

__all__ = ["GraphRegistry", "catalogue_from"]

log = logging.getLogger(__name__)
ACTION: Final = "/_action/"
SEND_GOAL: Final = f"{ACTION}send_goal"
ENTITY_BYTES: Final = 1024  # what a node or an endpoint weighs here, its texts included
PUBLISHER, SUBSCRIPTION = link_pb2.ENDPOINT_KIND_PUBLISHER, link_pb2.ENDPOINT_KIND_SUBSCRIPTION
SERVER, CLIENT = link_pb2.ENDPOINT_KIND_SERVER, link_pb2.ENDPOINT_KIND_CLIENT
Kinds = dict[int, dict[str, tuple[Endpoint, ...]]]


class GraphRegistry:
    """`of` reads, `watch` follows. All on the event loop; a robot's graph stays while its link is away."""

    def __init__(self, *, limits: Limits = LIMITS) -> None:
        self._limits = limits
        self._graphs: OrderedDict[str, _ReportedGraph] = OrderedDict()  # the robot that was heard last is the last one
        self._watchers: list[Callable[[str], None]] = []

    def of(self, robot_id: str) -> RobotGraph:
        """How a robot's graph stood when it was last heard; an empty one of revision 0 before that."""
        reported = self._graphs.get(robot_id)
        return reported.graph() if reported is not None else RobotGraph(robot=robot_id)

    def known(self) -> list[str]:
        """The robots that told something."""
        return [robot_id for robot_id, reported in self._graphs.items() if reported.revision]

    def knows(self, robot_id: str) -> bool:
        """Whether something of a robot is kept; the graphs of others may have taken its room."""
        return robot_id in self._graphs

    def reports(self, robot_id: str) -> list[link_pb2.GraphReport]:
        """All that is known of a robot, as its agent would report it anew; nothing where nothing is known."""
        reported = self._graphs.get(robot_id)
        return reported.reports(limits=self._limits) if reported is not None and reported.revision else []

    def watch(self, callback: Callable[[str], None]) -> Callable[[], None]:
        """Call `callback(robot_id)` after each change; returns how to stop that. It must not raise or wait."""
        self._watchers.append(callback)

        def stop() -> None:
            if callback in self._watchers:
                self._watchers.remove(callback)

        return stop

    def on_report(self, robot_id: str, report: link_pb2.GraphReport) -> None:
        """A robot's agent told something; changes are seen when all of a revision has come."""
        if report.anew or robot_id not in self._graphs:
            before = self._graphs.pop(robot_id, None)
            self._graphs[robot_id] = _ReportedGraph(robot_id, shown=before.graph() if before is not None else None)
        reported = self._graphs[robot_id]
        self._graphs.move_to_end(robot_id)
        reported.take(report, limits=self._limits)
        self._shed(robot_id)
        if report.more:
            return
        reported.settle(report.revision)
        for callback in list(self._watchers):
            callback(robot_id)

    def _shed(self, but: str) -> None:
        """Forget the graphs that were longest not spoken of, when all together are too large."""
        total = sum(reported.size_bytes for reported in self._graphs.values())
        for robot_id in list(self._graphs):
            if total <= self._limits.graphs_bytes:
                return
            if robot_id != but:
                total -= self._graphs.pop(robot_id).size_bytes


class _ReportedGraph:
    """What one robot's agent reported over its newest link. `shown` is what people see until that is complete."""

    def __init__(self, robot: str, *, shown: RobotGraph | None) -> None:
        self.robot = robot
        self.revision = 0
        self.nodes: dict[str, None] = {}
        self.endpoints: dict[int, link_pb2.GraphEndpoint] = {}
        self.types: dict[tuple[str, str], Catalogue] = {}
        self.texts: dict[tuple[str, str], link_pb2.TypeText] = {}  # of those, for other gateways
        self.left_out = self._refused = self._type_bytes = 0
        self._shown = shown

    @property
    def size_bytes(self) -> int:
        """About what it costs to keep."""
        return ENTITY_BYTES * (len(self.nodes) + len(self.endpoints)) + self._type_bytes

    def take(self, report: link_pb2.GraphReport, *, limits: Limits) -> None:
        """What appeared and went. What is over the limits is counted, not kept."""
        for number in report.endpoints_gone:
            self.endpoints.pop(number, None)
        for name in report.nodes_gone:
            self.nodes.pop(name, None)
        for name in report.nodes:
            if self._room(limits) and len(name) <= limits.ros_name_chars:
                self.nodes[name] = None
        for endpoint in report.endpoints:
            if self._room(limits) and endpoint.ByteSize() <= ENTITY_BYTES:
                self.endpoints[endpoint.number] = endpoint
        self._learn_all(report.types, limits)
        self.left_out = report.left_out + self._refused

    def settle(self, revision: int) -> None:
        """All of a revision is here: what was shown before is out of date."""
        self.revision, self._shown = revision, None

    def reports(self, *, limits: Limits) -> list[link_pb2.GraphReport]:
        """All of it, in pieces that can be read in one go each."""
        first = link_pb2.GraphReport(
            anew=True, nodes=self.nodes, endpoints=self.endpoints.values(), left_out=self.left_out
        )
        reports, room = [first], limits.graph_type_steps
        for text in self.texts.values():
            steps = parse_cost(text, enough=limits.graph_type_steps)
            if steps > room:
                reports.append(link_pb2.GraphReport())
                room = limits.graph_type_steps
            reports[-1].types.append(text)
            reports[-1].left_out = self.left_out
            room -= steps
        for report in reports:
            report.revision, report.more = self.revision, report is not reports[-1]
        return reports

    def graph(self) -> RobotGraph:
        """What people see."""
        if self._shown is None:
            self._shown = self._build()
        return self._shown

    def _room(self, limits: Limits) -> bool:
        room = len(self.nodes) + len(self.endpoints) < limits.graph_entities
        self._refused += not room
        return room

    def _learn_all(self, texts: Iterable[link_pb2.TypeText], limits: Limits) -> None:
        """As many as the event loop can read in one go; an agent begins another report before that."""
        room = limits.graph_type_steps
        for text in texts:
            if room < TYPE_STEPS:
                return
            steps = parse_cost(text, enough=room)
            if steps <= room:
                self._learn(text, limits)
            else:
                log.warning(
                    "robot %s tells a type that is not read (%s): %s takes more than %d steps",
                    self.robot,
                    TooLargeError.code,
                    text.type_name[:80],
                    room,
                )
            room -= steps if steps <= room else TYPE_STEPS

    def _learn(self, text: link_pb2.TypeText, limits: Limits) -> None:
        if len(self.types) >= limits.graph_types or self._type_bytes + text.ByteSize() > limits.graph_robot_bytes // 2:
            return
        try:
            catalogue = catalogue_from(text)
        except MetarosError as error:
            log.warning("robot %s tells a type that cannot be (%s): %s", self.robot, error.code, error)
            return
        self.types[text.type_name, text.type_hash] = catalogue
        self.texts[text.type_name, text.type_hash] = text
        self._type_bytes += text.ByteSize()

    def _build(self) -> RobotGraph:
        kinds = _by_kind(self.endpoints.values())
        servers, clients = kinds.get(SERVER, {}), kinds.get(CLIENT, {})
        names = {*servers, *clients}
        actions = {name.removesuffix(SEND_GOAL) for name in names if name.endswith(SEND_GOAL)}
        return RobotGraph(
            robot=self.robot,
            revision=self.revision,
            nodes=tuple(sorted(self.nodes)),
            publishers=_plain(kinds.get(PUBLISHER, {})),
            subscribers=_plain(kinds.get(SUBSCRIPTION, {})),
            services=MappingProxyType(
                {name: _service(servers.get(name, ()), clients.get(name, ())) for name in names if ACTION not in name}
            ),
            actions=MappingProxyType(
                {
                    name: _action(servers.get(name + SEND_GOAL, ()), clients.get(name + SEND_GOAL, ()))
                    for name in actions
                }
            ),
            left_out=self.left_out,
            types=MappingProxyType(dict(self.types)),
        )


def catalogue_from(text: link_pb2.TypeText) -> Catalogue:
    """A type with its parts, as a robot tells it. MetarosError where it has not the hash that it is told with."""
    catalogue = Catalogue(base=default_catalogue())
    catalogue.add_all([parse_definition(part.text, part.name) for part in text.parts])
    actual = type_hash(text.type_name, catalogue)
    if text.type_hash and actual != text.type_hash:
        raise MetarosError(f"{text.type_name[:80]} has the hash {actual}, not {text.type_hash[:80]}")
    return catalogue


def _by_kind(reported: Iterable[link_pb2.GraphEndpoint]) -> Kinds:
    def order(end: link_pb2.GraphEndpoint) -> tuple[int, str, str, int]:
        return (end.kind, end.name, end.node, end.number)

    found: Kinds = {}
    for (kind, name), ends in groupby(sorted(reported, key=order), key=lambda end: (end.kind, end.name)):
        found.setdefault(kind, {})[name] = tuple(
            Endpoint(end.node, end.type_name, end.type_hash, end.qos) for end in ends
        )
    return found


def _plain(ends: dict[str, tuple[Endpoint, ...]]) -> MappingProxyType[str, tuple[Endpoint, ...]]:
    return MappingProxyType({name: found for name, found in ends.items() if ACTION not in name})


def _service(servers: tuple[Endpoint, ...], clients: tuple[Endpoint, ...]) -> ServiceInfo:
    first = (*servers, *clients)[0]
    return ServiceInfo(first.type_name, first.type_hash, servers, clients)


def _action(servers: tuple[Endpoint, ...], clients: tuple[Endpoint, ...]) -> ActionInfo:
    first = (*servers, *clients)[0]
    type_name = first.type_name.removesuffix("_SendGoal")
    return ActionInfo(type_name, first.type_hash, _nodes(servers), _nodes(clients))


def _nodes(ends: tuple[Endpoint, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(end.node for end in ends))
