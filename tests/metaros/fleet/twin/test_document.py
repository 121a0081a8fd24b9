"""What a twin's document may say, and how exactly it is told what it may not."""

from __future__ import annotations

import contextlib
import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given

from metaros.fleet.twin import Twin, TwinError, canonical, json_schema, parse, parse_part
from metaros.fleet.twin.tables import SECTIONS
from tests.metaros.fleet.twin.documents import FEW, PATCHES
from tests.support.tables import cases

ROOT = Path(__file__).resolve().parents[4]
WHOLE: dict[str, Any] = {
    "topics": {"camera/image/compressed": {"class": "live", "rate_hz": 5}, "**": {"forward": False}},
    "nodes": {
        "lidar": {"bundle": "lidar-node", "version": "1.2.0", "parameters": {"a": [1, 2.5], "b.c": "x"}},
        "mapper": {"allowed": "mapper", "after": ["lidar"], "nice": 5, "restart": "never", "run": False},
    },
    "parameters": {"/lidar": {"rate_hz": 10.0}},
    "lifecycle": {"/lidar": "active"},
    "budget": {"bytes_per_s": 250000},
    "agent": {"version": "2.1.0"},
}


def test_a_whole_document() -> None:
    twin = parse(json.dumps(WHOLE))
    assert twin.nodes is not None
    assert twin.topics is not None
    assert (twin.nodes["lidar"].bundle, twin.nodes["lidar"].nice, twin.nodes["lidar"].run) == ("lidar-node", 0, True)
    assert (twin.nodes["mapper"].after, twin.nodes["mapper"].run) == (("lidar",), False)
    assert [row.pattern for row in twin.topics] == ["camera/image/compressed", "**"]
    assert (twin.topics[0].rate_hz, twin.topics[0].given) == (5.0, {"class", "rate_hz"})
    assert (twin.budget_bytes_per_s, twin.agent_version) == (250000, "2.1.0")
    assert twin.parameters == {"/lidar": {"rate_hz": 10.0}}
    assert twin.lifecycle == {"/lidar": "active"}
    assert twin.canonical == canonical(WHOLE)
    assert twin.sha256 == hashlib.sha256(twin.canonical).digest()


def test_an_absent_section_is_none_and_an_empty_one_is_not() -> None:
    assert parse("{}") == Twin(document={})
    assert parse({"nodes": {}, "topics": {}}).nodes == {}
    assert parse({"budget": {"bytes_per_s": 0}}).budget_bytes_per_s == 0


@cases(
    ("document", "said"),
    [
        ({"node": {}}, "node: unknown key; did you mean 'nodes'?"),
        ({"nodes": []}, "nodes: an object, not a list"),
        ({"nodes": None}, "nodes: an object, not null"),
        ({"nodes": {"lidar": {"allowed": "x", "nice": 40}}}, "nodes.lidar.nice: -20 to 19, not 40"),
        ({"nodes": {"lidar": {"allowed": "x", "nice": True}}}, "nodes.lidar.nice: a whole number, not true or false"),
        ({"nodes": {"lidar": {"allowed": "x", "nise": 4}}}, "nodes.lidar.nise: unknown key; did you mean 'nice'?"),
        ({"nodes": {"lidar": {}}}, "nodes.lidar: exactly one of bundle, allowed, command says what to run; found none"),
        ({"nodes": {"a": {"allowed": "x", "command": ["y"]}}}, "found allowed and command"),
        ({"nodes": {"a": {"bundle": "x"}}}, "nodes.a: `bundle` and `version` go together"),
        ({"nodes": {"a": {"allowed": "x", "version": "1.0"}}}, "nodes.a: `bundle` and `version` go together"),
        ({"nodes": {"a": {"bundle": "x", "version": "latest"}}}, "nodes.a.version: two to four numbers"),
        ({"nodes": {"a": {"bundle": "../x", "version": "1.0"}}}, "nodes.a.bundle: small letters"),
        ({"nodes": {"a": {"command": []}}}, "nodes.a.command: 1 to 64 items, not 0"),
        ({"nodes": {"a": {"command": ["x\0y"]}}}, "nodes.a.command[0]: text without control characters"),
        ({"nodes": {"a": {"allowed": "x", "restart": "alway"}}}, "did you mean 'always'?"),
        ({"nodes": {"a b": {"allowed": "x"}}}, "nodes['a b']: letters, digits and _"),
        ({"nodes": {"a": {"allowed": "x", "after": ["b"]}}}, "nodes.a.after: there is no node 'b'"),
        (
            {"nodes": {"lidar": {"allowed": "x"}, "a": {"allowed": "x", "after": ["lidr"]}}},
            "nodes.a.after: there is no node 'lidr' in this document; did you mean 'lidar'?",
        ),
        (
            {"nodes": {"a": {"allowed": "x", "after": ["b"]}, "b": {"allowed": "x", "after": ["a"]}}},
            "nodes: after: a circle",
        ),
        ({"nodes": {f"n{i}": {"allowed": "x"} for i in range(257)}}, "nodes: at most 256 nodes, not 257"),
        ({"topics": {"a b": {}}}, "topics['a b']: a pattern is"),
        ({"topics": {"scan": {"rate_hz": -1}}}, "topics.scan.rate_hz: 0 to 1e+06, not -1"),
        ({"topics": {"scan": {"class": "metric"}}}, "topics.scan.class: one of auto, event, bulk, live"),
        ({"topics": {"scan": {"deadband": 1}}}, "topics.scan.deadband: needs `fields`"),
        ({"topics": {"scan": {"class": "event", "latest_only": True}}}, "topics.scan.latest_only: cannot be"),
        ({"topics": {"scan": {"class": "bulk", "history_hz": 1}}}, "topics.scan.history_hz: is of live topics"),
        ({"topics": {f"t{i}": {} for i in range(4097)}}, "more than 4096 rows"),
        ({"parameters": {"/l": {"x": {"y": 1}}}}, "parameters['/l'].x: true or false, a number, text or a list"),
        ({"parameters": {"/l": {"x": [1, "a"]}}}, "parameters['/l'].x: a list of one kind"),
        ({"parameters": {"/l": {"x": [[1]]}}}, "parameters['/l'].x[0]: true or false"),
        ({"parameters": {"/l": {"x y": 1}}}, "parameters['/l']['x y']: a parameter's name"),
        ({"parameters": {"l/": {}}}, "parameters['l/']: a node's name"),
        ({"lifecycle": {"/l": "on"}}, "lifecycle['/l']: one of inactive, active, finalized"),
        ({"budget": {"bytes_per_s": 999}}, "budget.bytes_per_s: 0, or 1000 to"),
        ({"budget": {"bytes_per_s": 2.5}}, "budget.bytes_per_s: a whole number, not 2.5"),
        ({"agent": {"version": 2}}, "agent.version: text, not a number"),
    ],
)
def test_the_path_and_the_limit_are_named(document: Any, said: str) -> None:
    with pytest.raises(TwinError) as caught:
        parse(json.dumps(document))
    assert said in str(caught.value)
    assert caught.value.code == "twin_invalid"


def test_a_part_may_take_away_and_need_not_say_all() -> None:
    part = {
        "topics": None,
        "nodes": {"lidar": {"nice": 5, "bundle": None, "parameters": {"x": None, "y": 1}}, "old": None},
        "parameters": {"/lidar": None, "/gps": {"rate": None}},
        "lifecycle": {"/lidar": None},
        "budget": {"bytes_per_s": None},
    }
    assert parse_part(part) == part
    for wrong in ({"nodes": {"a": {"nice": 40}}}, {"nodes": {"a": {"args": [None]}}}, {"x": None}, {"nodes": 1}):
        with pytest.raises(TwinError):
            parse_part(json.dumps(wrong))
    with pytest.raises(TwinError):
        parse({"nodes": {"a": {"allowed": "x", "nice": None}}})


@FEW
@given(PATCHES)
def test_whatever_is_given_it_is_taken_or_refused(document: Any) -> None:
    for take in (parse, parse_part):
        with contextlib.suppress(TwinError):
            take(document)


def test_every_key_is_documented() -> None:
    text = (ROOT / "docs" / "reference" / "twin.md").read_text()
    keys = [*SECTIONS, *(key for section in SECTIONS.values() for key in section.keys or ())]
    assert [key for key in keys if f"| `{key}` |" not in text] == []


def test_the_schema_names_every_key() -> None:
    schema = json_schema()
    assert set(schema["properties"]) == set(SECTIONS)
    node = schema["properties"]["nodes"]["additionalProperties"]
    assert set(node["properties"]) == set(SECTIONS["nodes"].keys or ())
    assert (node["properties"]["nice"]["minimum"], node["properties"]["nice"]["default"]) == (-20, 0)
    assert json.loads(json.dumps(schema)) == schema
