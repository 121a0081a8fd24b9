"""What robots tell of their graphs: how much of it a gateway reads at a time."""

from __future__ import annotations

import logging

import pytest

from edge_agent.ros.graph_report import GraphReporter
from edge_agent.ros.graph_snapshot import GraphSnapshot
from gateway.fleet.ros import graph_registry
from gateway.fleet.ros.graph_registry import GraphRegistry, catalogue_from
from metaros._proto import link_pb2
from metaros.limits import LIMITS

STEPS = LIMITS.graph_type_steps
DEEP = "visualization_msgs/msg/InteractiveMarkerUpdate a\n"  # brings 16 messages along
HOSTILE = {  # reports of 120 KiB, each of which took from 0.1 to 0.4 s
    "many fields": [("p/msg/A", "".join(f"int8 f{field}\n" for field in range(3400)))] * 3,
    "small actions": [(f"p/action/A{number}", "---\n---\n") for number in range(2500)],
    "deep messages": [(f"p/msg/A{number}", DEEP) for number in range(1500)],
    "a long list": [("p/msg/A", "int8[] a [" + "1," * 60_000 + "1]\n")],
    "a list of texts": [("p/msg/A", "string[] a [" + "''," * 40_000 + "'']\n")],
    "apostrophes": [("p/msg/A", "string[] a [a" + "'" * 120_000 + "]\n")],
    "a long text": [("p/msg/A", "string a '" + "x" * 120_000 + "'\n")],
    "comments": [("p/msg/A", "#\n" * 60_000 + "int8 a\n")],
    "other ends of lines": [("p/msg/A", "int8 a\f\v\r\x1c\u2028" * 9000)],
}


def reported(number: int, fields: int) -> link_pb2.TypeText:
    """A service type of so many fields."""
    text = "".join(f"int32 field_{field}\n" for field in range(fields)) + "---\nint32 b\n"
    name = f"p/srv/S{number}"
    return link_pb2.TypeText(type_name=name, parts=[link_pb2.TypePart(name=name, text=text)])


def known(*types: link_pb2.TypeText) -> list[str]:
    """What a gateway learns from one report."""
    registry = GraphRegistry()
    registry.on_report("r", link_pb2.GraphReport(anew=True, revision=1, types=types))
    return [name for name, _ in registry.of("r").types]


def read_of(monkeypatch: pytest.MonkeyPatch, *types: link_pb2.TypeText) -> list[link_pb2.TypeText]:
    """The types of one report that are parsed at all, whatever becomes of them."""
    read: list[link_pb2.TypeText] = []

    def reading(text: link_pb2.TypeText) -> object:
        read.append(text)
        return catalogue_from(text)

    monkeypatch.setattr(graph_registry, "catalogue_from", reading)
    known(*types)
    return read


@pytest.mark.parametrize("case", HOSTILE)
def test_a_report_brings_the_event_loop_little_to_read(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    types = [
        link_pb2.TypeText(type_name=name, type_hash="x", parts=[link_pb2.TypePart(name=name, text=text)])
        for name, text in HOSTILE[case]
    ]
    read = read_of(monkeypatch, *types)
    assert len(read) <= 10  # each brings its hash and common messages along
    assert sum(len(part.text.splitlines()) for text in read for part in text.parts) < STEPS
    assert sum(text.ByteSize() for text in read) < 64 * STEPS


def test_parts_without_text_are_not_read_by_the_thousand(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, most in (("p/msg/A", STEPS // 2), ("p/action/A", STEPS // 8)):
        parts = [link_pb2.TypePart(name=name)] * 9000
        assert read_of(monkeypatch, link_pb2.TypeText(type_name=name, parts=parts)) == []
        assert read_of(monkeypatch, link_pb2.TypeText(type_name=name, parts=parts[:most])) == []


def test_a_type_that_is_too_large_is_refused_by_its_code_and_the_rest_of_the_report_is_used(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.WARNING):
        assert known(reported(1, 50), reported(2, 1000), reported(3, 50)) == ["p/srv/S1", "p/srv/S3"]
    (record,) = caplog.records
    assert "(too_large): p/srv/S2" in record.getMessage()
    assert known(reported(1, 400)) == ["p/srv/S1"]  # twice of what the largest services of moveit_msgs have


def test_all_types_of_an_agent_arrive_whatever_their_sizes() -> None:
    sizes = [1, 400, 90, 90, 400, 1, 1, 1, 400, *[1] * 20, *[30] * 20]
    types = {(f"p/srv/S{number}", ""): reported(number, size) for number, size in enumerate(sizes)}
    registry = GraphRegistry()
    for frame in GraphReporter().changes(GraphSnapshot(frozenset({"/r/a"}), {}), types):
        registry.on_report("r", frame)
    assert registry.of("r").types.keys() == types.keys()
