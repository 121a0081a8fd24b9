"""What is told of the graph adds up to what is there, whatever changed and however often; in frames of bounded size."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from dataclasses import replace

from edge_agent.ros.graph_report import FRAME_ITEMS, GraphReporter
from edge_agent.ros.graph_snapshot import GraphEndpoint, GraphSnapshot
from gateway.fleet.ros.graph_registry import GraphRegistry
from metaros._proto import link_pb2
from metaros.limits import LIMITS


def end(name: str, *, kind: int = link_pb2.ENDPOINT_KIND_PUBLISHER, node: str = "/r/a") -> GraphEndpoint:
    return GraphEndpoint(kind, node, name, "std_msgs/msg/String", "RIHS01_00", "::,10:,:,:,,")


def tell(registry: GraphRegistry, reporter: GraphReporter, now: GraphSnapshot) -> int:
    frames = reporter.changes(now)
    for frame in frames:
        registry.on_report("r", link_pb2.GraphReport.FromString(frame.SerializeToString()))
    return len(frames)


def seen(registry: GraphRegistry) -> tuple[set[str], set[tuple[str, str]]]:
    graph = registry.of("r")
    return set(graph.nodes), {(topic, item.node) for topic, endpoints in graph.publishers.items() for item in endpoints}


def test_differences_add_up_over_a_thousand_changes_and_new_links() -> None:
    rng = random.Random(7)
    registry, reporter, endpoints, nodes = GraphRegistry(), GraphReporter(), {}, set()
    for step in range(1000):
        for _ in range(rng.randrange(4)):
            gid = rng.randrange(60).to_bytes(16, "big")
            if gid in endpoints and rng.random() < 0.5:
                del endpoints[gid]
            else:
                endpoints[gid] = end(f"/r/t{rng.randrange(20)}", node=f"/r/n{rng.randrange(9)}")
            nodes ^= {f"/r/n{rng.randrange(9)}"}
        if step % 97 == 0:
            reporter.begin()  # another link
        tell(registry, reporter, GraphSnapshot(frozenset(nodes), dict(endpoints)))
        assert seen(registry) == (nodes, {(item.name, item.node) for item in endpoints.values()})
    assert (
        tell(registry, reporter, GraphSnapshot(frozenset(nodes), dict(endpoints))) == 0
    )  # nothing changed: nothing is told


def test_a_large_graph_travels_in_pieces_and_is_seen_when_all_are_there() -> None:
    registry, reporter = GraphRegistry(), GraphReporter()
    reported: list[str] = []
    registry.watch(reported.append)
    endpoints = {number.to_bytes(16, "big"): end(f"/r/t{number}") for number in range(1000)}
    frames = reporter.changes(GraphSnapshot(frozenset({"/r/a"}), endpoints))
    assert len(frames) == -(-1001 // FRAME_ITEMS)
    assert max(frame.ByteSize() for frame in frames) < LIMITS.frame_bytes // 8
    for frame in frames[:-1]:
        registry.on_report("r", frame)
        assert (registry.of("r").revision, reported) == (0, [])
    registry.on_report("r", frames[-1])
    assert (len(registry.of("r").publishers), reported) == (1000, ["r"])
    assert registry.known() == ["r"]


def test_what_is_beyond_the_limit_is_counted_at_both_ends() -> None:
    limits = replace(LIMITS, graph_entities=10)
    endpoints = {number.to_bytes(16, "big"): end(f"/r/t{number}") for number in range(12)}
    now = GraphSnapshot(frozenset({"/r/a"}), endpoints)
    registry = GraphRegistry()
    tell(registry, GraphReporter(limits=limits), now)
    assert (len(registry.of("r").publishers), registry.of("r").left_out) == (9, 3)
    strict = GraphRegistry(limits=limits)
    tell(strict, GraphReporter(), now)  # an agent that does not keep to it
    assert (len(strict.of("r").publishers), strict.of("r").left_out) == (9, 3)


def test_the_graphs_of_all_robots_together_are_bounded() -> None:
    registry = GraphRegistry(limits=replace(LIMITS, graphs_bytes=50 * 1024))
    for number in range(10):
        report = link_pb2.GraphReport(revision=1, anew=True, nodes=[f"/r{number}/n{item}" for item in range(10)])
        registry.on_report(f"r{number}", report)
    assert registry.known() == ["r5", "r6", "r7", "r8", "r9"]
    assert registry.of("r0").revision == 0
