"""Differences, and their way back."""

from __future__ import annotations

from typing import Any

from hypothesis import given

from metaros.fleet.twin import ABSENT, apply, diff, same
from tests.metaros.fleet.twin.documents import DOCUMENTS, FEW, PATCHES


@FEW
@given(PATCHES, PATCHES)
def test_the_changes_lead_from_one_to_the_other(old: Any, new: Any) -> None:
    changes = diff(old, new)
    assert same(apply(old, changes), new)
    assert bool(changes) != same(old, new)


@FEW
@given(DOCUMENTS)
def test_a_document_does_not_differ_from_itself(document: Any) -> None:
    assert diff(document, document) == []


def test_one_line_says_what_changed() -> None:
    old = {"nodes": {"lidar": {"nice": 0, "args": ["-v"]}}, "budget": {"bytes_per_s": 5000}}
    new = {"nodes": {"lidar": {"nice": 5, "args": ["-q"]}}, "parameters": {"/lidar": {"rate_hz": 10.0}}}
    assert [change.text for change in diff(old, new)] == [
        '- /budget: {"bytes_per_s": 5000}',
        '~ /nodes/lidar/args: ["-v"] → ["-q"]',
        "~ /nodes/lidar/nice: 0 → 5",
        '+ /parameters: {"/lidar": {"rate_hz": 10.0}}',
    ]
    assert [change.verb for change in diff(old, new)] == ["remove", "change", "change", "add"]


def test_slashes_and_tildes_in_keys_are_escaped() -> None:
    (change,) = diff({"parameters": {"/lidar": {"a~b": 1}}}, {"parameters": {"/lidar": {"a~b": 2}}})
    assert change.path == "/parameters/~1lidar/a~0b"
    assert change.as_json() == {"path": change.path, "verb": "change", "old": 1, "new": 2}


def test_null_is_a_value_and_absent_is_none() -> None:
    (change,) = diff({}, {"nodes": None})
    assert change.old is ABSENT
    assert change.as_json() == {"path": "/nodes", "verb": "add", "new": None}
