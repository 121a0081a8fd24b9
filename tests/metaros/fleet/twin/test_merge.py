"""Merge patches: the examples of RFC 7396 and the laws that templates and edits rest on."""

from __future__ import annotations

import copy
from typing import Any

from hypothesis import given

from metaros.fleet.twin import merge, merge_all, patch_between, same
from tests.metaros.fleet.twin.documents import DOCUMENTS, FEW, PATCHES, VALUES
from tests.support.tables import cases

# RFC 7396, appendix A: original, patch, result.
EXAMPLES: list[tuple[Any, Any, Any]] = [
    ({"a": "b"}, {"a": "c"}, {"a": "c"}),
    ({"a": "b"}, {"b": "c"}, {"a": "b", "b": "c"}),
    ({"a": "b"}, {"a": None}, {}),
    ({"a": "b", "b": "c"}, {"a": None}, {"b": "c"}),
    ({"a": ["b"]}, {"a": "c"}, {"a": "c"}),
    ({"a": "c"}, {"a": ["b"]}, {"a": ["b"]}),
    ({"a": {"b": "c"}}, {"a": {"b": "d", "c": None}}, {"a": {"b": "d"}}),
    ({"a": [{"b": "c"}]}, {"a": [1]}, {"a": [1]}),
    (["a", "b"], ["c", "d"], ["c", "d"]),
    ({"a": "b"}, ["c"], ["c"]),
    ({"a": "foo"}, None, None),
    ({"a": "foo"}, "bar", "bar"),
    ({"e": None}, {"a": 1}, {"e": None, "a": 1}),
    ([1, 2], {"a": "b", "c": None}, {"a": "b"}),
    ({}, {"a": {"bb": {"ccc": None}}}, {"a": {"bb": {}}}),
]


@cases(("base", "patch", "result"), EXAMPLES)
def test_the_examples_of_the_rfc(base: Any, patch: Any, result: Any) -> None:
    assert merge(base, patch) == result


@FEW
@given(DOCUMENTS, PATCHES)
def test_a_patch_twice_is_a_patch_once(base: Any, patch: Any) -> None:
    once = merge(base, patch)
    assert same(merge(once, patch), once)


@FEW
@given(VALUES, VALUES)
def test_nothing_given_is_changed_and_nothing_is_shared(base: Any, patch: Any) -> None:
    kept = copy.deepcopy((base, patch))
    found = merge(base, patch)
    _spoil(found)
    assert same([base, patch], list(kept))


@FEW
@given(DOCUMENTS, DOCUMENTS)
def test_the_patch_between_two_leads_from_one_to_the_other(old: Any, new: Any) -> None:
    assert same(merge(old, patch_between(old, new)), new)
    assert patch_between(new, new) == {}


@FEW
@given(PATCHES, PATCHES, PATCHES)
def test_patches_in_a_row_are_applied_from_the_left(one: Any, two: Any, three: Any) -> None:
    assert same(merge_all([one, two, three]), merge(merge(merge({}, one), two), three))


@FEW
@given(PATCHES, PATCHES)
def test_no_null_is_left_in_objects(one: Any, two: Any) -> None:
    def nulls(value: Any) -> bool:
        return isinstance(value, dict) and any(item is None or nulls(item) for item in value.values())

    assert not nulls(merge_all([one, two]))


def test_numbers_of_another_kind_are_another_value() -> None:
    assert not same({"a": 1}, {"a": 1.0})
    assert not same(True, 1)
    assert not same(0.0, -0.0)
    assert patch_between({"a": 1}, {"a": 1.0}) == {"a": 1.0}


def _spoil(value: Any) -> None:
    if isinstance(value, dict):
        for item in value.values():
            _spoil(item)
        value["spoilt"] = True
    elif isinstance(value, list):
        for item in value:
            _spoil(item)
        value.append("spoilt")
