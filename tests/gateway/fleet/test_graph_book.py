"""What robots tell of their graphs: how much of it a gateway reads at a time."""

from __future__ import annotations

from edge_agent.ros.report import GraphTeller
from edge_agent.ros.survey import Survey
from gateway.fleet.graph_book import TYPES_BYTES, GraphBook
from metaros._proto import link_pb2
from metaros.limits import LIMITS


def told(number: int, size_bytes: int) -> link_pb2.TypeText:
    """A service type of about that size."""
    comment = "#" + "x" * 998 + "\n"
    text = f"{comment * (size_bytes // 1000)}int32 a\n---\nint32 b\n"
    name = f"p/srv/S{number}"
    return link_pb2.TypeText(type_name=name, parts=[link_pb2.TypePart(name=name, text=text)])


def known(*types: link_pb2.TypeText) -> int:
    """How many of these a gateway learns from one report."""
    book = GraphBook()
    book.on_report("r", link_pb2.GraphReport(anew=True, revision=1, types=types))
    return len(book.of("r").types)


def test_a_report_brings_the_event_loop_no_megabytes_of_types_to_read() -> None:
    assert known(*(told(number, 1000) for number in range(8))) == 8
    assert known(*(told(number, 20_000) for number in range(100))) <= TYPES_BYTES / 20_000 + 1
    assert known(told(1, 1000), told(2, LIMITS.schema_bytes - 10_000), told(3, 1000)) == 2
    assert known(told(1, LIMITS.schema_bytes + 10_000)) == 0


def test_all_types_of_an_agent_arrive_however_large_they_are() -> None:
    sizes = [1000, 200_000, 90_000, 90_000, 30_000, 1000, 1000, 200_000, *[40_000] * 20]
    types = {(f"p/srv/S{number}", ""): told(number, size) for number, size in enumerate(sizes)}
    book = GraphBook()
    for frame in GraphTeller().tell(Survey(frozenset({"/r/a"}), {}), types):
        book.on_report("r", frame)
    assert book.of("r").types.keys() == types.keys()
