"""Which services a client is told of."""

from __future__ import annotations

from gateway.api.foxglove.calling import KnownServices
from gateway.domain.client_names import ClientNames
from gateway.fleet.ros.graph_registry import GraphRegistry
from metaros._proto import link_pb2
from tests.gateway.api.foxglove.robot import TRIGGER, endpoint


def test_a_robots_services_are_read_again_when_its_graph_is_another() -> None:
    registry, known, names = GraphRegistry(), KnownServices(), ClientNames()

    def reported(*services: str, robot: str, revision: int) -> list[tuple[str, str, str, str]]:
        ends = [endpoint(number, "server", name, TRIGGER, "/n") for number, name in enumerate(services)]
        registry.on_report(robot, link_pb2.GraphReport(revision=revision, anew=True, nodes=["/n"], endpoints=ends))
        return known.of([registry.of("r1"), registry.of("r2")], names)

    first = reported("/a", robot="r1", revision=1)
    assert [(name, kind) for name, kind, _, _ in first] == [("/r1/a", TRIGGER)]
    both = reported("/b", robot="r2", revision=1)
    assert [item[0] for item in both] == ["/r1/a", "/r2/b"]
    assert both[0] is first[0]  # of the robot that did not change nothing was read
    assert [item[0] for item in reported("/c", robot="r1", revision=2)] == ["/r1/c", "/r2/b"]
    assert reported(robot="r1", revision=3) == both[1:]
