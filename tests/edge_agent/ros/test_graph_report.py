"""What is told of the graph adds up to what is there, whatever changed and however often; in frames of bounded size."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from dataclasses import replace

from edge_agent.ros.report import FRAME_ITEMS, GraphTeller
from edge_agent.ros.survey import End, Survey
from gateway.fleet.graph_book import GraphBook
from metaros._proto import link_pb2
from metaros.limits import LIMITS


def end(name: str, *, kind: int = link_pb2.ENDPOINT_KIND_PUBLISHER, node: str = "/r/a") -> End:
    return End(kind, node, name, "std_msgs/msg/String", "RIHS01_00", "::,10:,:,:,,")


def tell(book: GraphBook, teller: GraphTeller, now: Survey) -> int:
    frames = teller.tell(now)
    for frame in frames:
        book.on_report("r", link_pb2.GraphReport.FromString(frame.SerializeToString()))
    return len(frames)


def seen(book: GraphBook) -> tuple[set[str], set[tuple[str, str]]]:
    graph = book.of("r")
    return set(graph.nodes), {(topic, item.node) for topic, ends in graph.publishers.items() for item in ends}


def test_differences_add_up_over_a_thousand_changes_and_new_links() -> None:
    rng = random.Random(7)
    book, teller, ends, nodes = GraphBook(), GraphTeller(), {}, set()
    for step in range(1000):
        for _ in range(rng.randrange(4)):
            gid = rng.randrange(60).to_bytes(16, "big")
            if gid in ends and rng.random() < 0.5:
                del ends[gid]
            else:
                ends[gid] = end(f"/r/t{rng.randrange(20)}", node=f"/r/n{rng.randrange(9)}")
            nodes ^= {f"/r/n{rng.randrange(9)}"}
        if step % 97 == 0:
            teller.begin()  # another link
        tell(book, teller, Survey(frozenset(nodes), dict(ends)))
        assert seen(book) == (nodes, {(item.name, item.node) for item in ends.values()})
    assert tell(book, teller, Survey(frozenset(nodes), dict(ends))) == 0  # nothing changed: nothing is told


def test_a_large_graph_travels_in_pieces_and_is_seen_when_all_are_there() -> None:
    book, teller = GraphBook(), GraphTeller()
    told: list[str] = []
    book.watch(told.append)
    ends = {number.to_bytes(16, "big"): end(f"/r/t{number}") for number in range(1000)}
    frames = teller.tell(Survey(frozenset({"/r/a"}), ends))
    assert len(frames) == -(-1001 // FRAME_ITEMS)
    assert max(frame.ByteSize() for frame in frames) < LIMITS.frame_bytes // 8
    for frame in frames[:-1]:
        book.on_report("r", frame)
        assert (book.of("r").revision, told) == (0, [])
    book.on_report("r", frames[-1])
    assert (len(book.of("r").publishers), told) == (1000, ["r"])
    assert book.known() == ["r"]


def test_what_is_beyond_the_limit_is_counted_at_both_ends() -> None:
    limits = replace(LIMITS, graph_entities=10)
    ends = {number.to_bytes(16, "big"): end(f"/r/t{number}") for number in range(12)}
    now = Survey(frozenset({"/r/a"}), ends)
    book = GraphBook()
    tell(book, GraphTeller(limits=limits), now)
    assert (len(book.of("r").publishers), book.of("r").left_out) == (9, 3)
    strict = GraphBook(limits=limits)
    tell(strict, GraphTeller(), now)  # an agent that does not keep to it
    assert (len(strict.of("r").publishers), strict.of("r").left_out) == (9, 3)


def test_the_graphs_of_all_robots_together_are_bounded() -> None:
    book = GraphBook(limits=replace(LIMITS, graphs_bytes=50 * 1024))
    for number in range(10):
        report = link_pb2.GraphReport(revision=1, anew=True, nodes=[f"/r{number}/n{item}" for item in range(10)])
        book.on_report(f"r{number}", report)
    assert book.known() == ["r5", "r6", "r7", "r8", "r9"]
    assert book.of("r0").revision == 0
