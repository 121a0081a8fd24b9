"""ROS parameters as JSON: there and back, and what a descriptor forbids."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.domain.fleet.parameter import KINDS, Bounds, Rules, plain, rules_of, wired
from metaros.errors import ParameterError
from tests.support.tables import refusal

BIG = st.integers(-(1 << 63), (1 << 63) - 1)
VALUES: dict[str, st.SearchStrategy[Any]] = {
    "bool": st.booleans(),
    "integer": BIG,
    "double": st.floats(allow_nan=False),
    "string": st.text(max_size=20),
    "byte_array": st.lists(st.integers(0, 255), max_size=5),
    "bool_array": st.lists(st.booleans(), max_size=5),
    "integer_array": st.lists(BIG, max_size=5),
    "double_array": st.lists(st.floats(allow_nan=False), max_size=5),
    "string_array": st.lists(st.text(max_size=5), max_size=5),
}


@pytest.mark.parametrize("kind", VALUES)
def test_every_kind_comes_back_as_it_went(kind: str) -> None:
    @settings(max_examples=30)
    @given(VALUES[kind])
    def check(value: Any) -> None:
        wire = wired(value, kind)
        assert KINDS[wire["type"]][0] == kind
        found, back = plain(wire)
        assert found == kind
        assert wired(back, kind) == wire  # also as text, beyond what a browser counts to

    check()


NOT_OF_THE_KIND: tuple[tuple[Any, str], ...] = (
    (1.5, "integer"),
    ("x1", "integer"),
    (1 << 63, "integer"),
    (True, "integer"),
    (1, "bool"),
    ("1", "double"),
    ((1 << 60) + 1, "double"),
    (10**400, "double"),
    (5, "string"),
    ([1, "a"], "integer_array"),
    (3, "integer_array"),
    ([256], "byte_array"),
    ({}, "not_set"),
    ([[1]], "not_set"),
    ([1, True], "not_set"),
)


def test_what_is_not_of_the_kind_is_refused() -> None:
    assert [(value, kind) for value, kind in NOT_OF_THE_KIND if not refusal(ParameterError, wired, value, kind)] == []


def test_nothing_is_lost_between_kinds() -> None:
    assert wired(5, "double") == {"type": 3, "double_value": 5.0}
    assert wired("nan", "double")["double_value"] != wired("inf", "double")["double_value"] == math.inf
    assert wired([1, 2.5], "not_set") == {"type": 8, "double_array_value": [1.0, 2.5]}
    assert wired([], "not_set") == {"type": 9, "string_array_value": []}
    assert wired(None, "integer") == {"type": 0}
    assert plain({"type": 2, "integer_value": (1 << 53) + 1}) == ("integer", str((1 << 53) + 1))
    assert plain({"type": 99}) == ("not_set", None)


def descriptor(**facts: Any) -> dict[str, Any]:
    known = {"name": "rate", "type": 3, "description": "", "additional_constraints": "", "read_only": False}
    return {**known, "dynamic_typing": False, "integer_range": [], "floating_point_range": [], **facts}


def test_rules_forbid_what_the_node_would() -> None:
    bounds = [{"from_value": 0.0, "to_value": 1.0, "step": 0.25}]
    rate = rules_of(descriptor(floating_point_range=bounds))
    assert (rate.kind, rate.floating_point_range) == ("double", Bounds(0.0, 1.0, 0.25))
    assert [bool(rate.fault(value)) for value in (0, 0.5, 1, 0.3, 2, "x", None)] == [False] * 3 + [True] * 4
    assert rules_of(descriptor(read_only=True)).fault(0.5) == "it is read-only"
    count = rules_of(descriptor(type=2, integer_range=[{"from_value": 1, "to_value": 9, "step": 0}]))
    assert [bool(count.fault(value)) for value in (1, "9", 10, 0)] == [False, False, True, True]
    free = Rules(name="x", kind="integer", dynamic_typing=True)
    assert [free.fault(value) for value in ("text", None, 4)] == ["", "", ""]
    assert rules_of(descriptor(type=77, floating_point_range=[{**bounds[0], "to_value": None}])).kind == "not_set"
