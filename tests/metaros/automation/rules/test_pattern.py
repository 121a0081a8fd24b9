"""The pattern language: what matches, what is refused and where, and that no pattern and no event makes it slow."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from metaros.automation.rules.errors import PatternError
from metaros.automation.rules.pattern import compile_pattern
from metaros.limits import LIMITS
from tests.support.tables import cases

Document = dict[str, Any]

EVENT: Document = {
    "version": "0",
    "id": "e-17",
    "detail-type": "metaros.alert.raised",
    "source": "metaros",
    "time": "2026-11-22T18:00:00Z",
    "resources": ["arn:metaros:robot:spot-1", "arn:metaros:site:hall"],
    "detail": {
        "robot": "spot-1",
        "severity": "Warning",
        "level": 17.5,
        "count": 3,
        "address": "10.0.3.4",
        "address6": "2001:db8::17",
        "silenced": None,
        "note": "",
        "ok": False,
        "joints": [{"name": "hip", "torque": 3.0}, {"name": "knee", "torque": 9.0}],
        "faults": ["hot", "loose"],
    },
}


def matches(detail: Document, about: Document = EVENT) -> bool:
    """Whether what is asked of the event's detail holds."""
    return compile_pattern({"detail": detail}).matches(about)


@cases(
    "detail",
    [
        {"robot": ["spot-2", "spot-1"]},
        {"count": [3.0]},
        {"ok": [False]},
        {"silenced": [None]},
        {"note": [""]},
        {"severity": [{"equals-ignore-case": "WARNING"}]},
        {"severity": [{"prefix": "Warn"}]},
        {"severity": [{"prefix": {"equals-ignore-case": "wARN"}}]},
        {"severity": [{"suffix": "ing"}]},
        {"severity": [{"suffix": {"equals-ignore-case": "ING"}}]},
        {"severity": [{"wildcard": "W*n*g"}]},
        {"severity": [{"anything-but": "warning"}]},
        {"severity": [{"anything-but": ["info", "error"]}]},
        {"severity": [{"anything-but": {"prefix": ["I", "E"]}}]},
        {"severity": [{"anything-but": {"suffix": "x"}}]},
        {"severity": [{"anything-but": {"wildcard": ["*x*", "I*"]}}]},
        {"severity": [{"anything-but": {"equals-ignore-case": ["info"]}}]},
        {"severity": [{"anything-but": {"prefix": {"equals-ignore-case": "x"}}}]},
        {"level": [{"anything-but": [1, 2]}]},
        {"level": [{"anything-but": "17.5"}]},
        {"level": [{"numeric": [">", 17, "<=", 17.5]}]},
        {"level": [{"numeric": ["<", 18, ">=", 17.5]}]},
        {"level": [{"numeric": ["=", 17.5]}]},
        {"address": [{"cidr": "10.0.0.0/16"}]},
        {"address6": [{"cidr": "2001:db8::/32"}]},
        {"silenced": [{"exists": True}]},
        {"gone": [{"exists": False}]},
        {"gone": {"deeper": [{"exists": False}]}},
        {"robot": {"deeper": [{"exists": False}]}},
        {"joints": [{"exists": False}]},
        {"joints": {"name": ["knee"], "torque": [{"numeric": [">", 5]}]}},
        {"joints": {"name": ["knee"], "speed": [{"exists": False}]}},
        {"faults": ["loose"]},
        {"faults": [{"anything-but": "hot"}]},
        {"$or": [{"robot": ["x"]}, {"count": [3], "ok": [False]}]},
        {"$or": [{"robot": ["x"]}, {"$or": [{"count": [4]}, {"ok": [False]}]}], "note": [""]},
    ],
)
def test_what_holds(detail: Document) -> None:
    assert matches(detail)


@cases(
    "detail",
    [
        {"robot": ["SPOT-1"]},
        {"count": ["3"]},
        {"count": [True]},
        {"ok": [0]},
        {"ok": [{"numeric": ["<", 5]}]},
        {"note": [None]},
        {"silenced": [""]},
        {"silenced": [{"exists": False}]},
        {"silenced": [{"numeric": ["=", 0]}]},
        {"gone": [{"anything-but": "x"}]},
        {"gone": [None]},
        {"gone": [{"exists": True}]},
        {"joints": [{"exists": True}]},
        {"joints": {"name": [{"exists": False}]}},
        {"joints": {"name": ["hip"], "torque": [9.0]}},
        {"level": [{"numeric": [">", 17.5]}]},
        {"address": [{"cidr": "10.0.4.0/24"}]},
        {"address": [{"cidr": "::/0"}]},
        {"robot": [{"cidr": "0.0.0.0/0"}]},
        {"severity": [{"wildcard": "W*g*g"}]},
        {"robot": [{"wildcard": "spot-1*1"}]},
        {"severity": [{"anything-but": {"equals-ignore-case": "warning"}}]},
        {"$or": [{"robot": ["x"]}, {"count": [3], "ok": [True]}]},
        {"robot": ["spot-1"], "$or": [{"count": [1]}, {"count": [2]}]},
    ],
)
def test_what_does_not_hold(detail: Document) -> None:
    assert not matches(detail)


def test_a_list_of_the_event_is_looked_through() -> None:
    assert compile_pattern({"resources": [{"suffix": ":site:hall"}]}).matches(EVENT)


def test_absence_in_a_list_of_objects_is_absence_in_each() -> None:
    lacking = {"joints": {"torque": [{"exists": False}]}}
    assert matches(lacking, {"detail": {"joints": []}})
    assert matches(lacking, {"detail": {"joints": [{"name": "hip"}, {}]}})
    assert not matches(lacking, {"detail": {"joints": [{"torque": 1}, {}]}})


def test_lists_in_lists_are_one_list() -> None:
    assert matches({"joints": {"name": ["knee"]}}, {"detail": {"joints": [[[{"name": "knee"}]], 5]}})
    assert matches({"faults": ["hot"]}, {"detail": {"faults": [[["hot"]]]}})


@cases(
    ("document", "said"),
    [
        ({}, "an empty object says nothing"),
        ({"a": {"b": {}}}, "a.b: an empty object says nothing"),
        ({"a": []}, "a: an empty list matches nothing"),
        ({"a": "x"}, "a: is a list of values or an object, as in ['x']"),
        ({"a": [["x"]]}, "a[0]: an entry is a text, a number"),
        ({"a": [float("nan")]}, "a[0]: an entry is a text, a number"),
        ({"a": [1, {"prefx": "x"}]}, "a[1].prefx: there is no such operator; there are prefix,"),
        ({"a": [{"prefix": "x", "suffix": "y"}]}, "a[0]: one operator an entry, not 2"),
        ({"a": [{}]}, "a[0]: one operator an entry, not 0"),
        ({"a": [{"prefix": 5}]}, "a[0].prefix: is a text, or {'equals-ignore-case': text}"),
        ({"a": [{"suffix": {"equals-ignore-case": 5}}]}, "a[0].suffix.equals-ignore-case: is a text"),
        ({"a": [{"exists": "yes"}]}, "a[0].exists: is true or false"),
        ({"a": [{"numeric": [">"]}]}, "a[0].numeric: is like"),
        ({"a": [{"numeric": [">", "5"]}]}, "a[0].numeric: is like"),
        ({"a": [{"numeric": [">", True]}]}, "'True' is no number"),
        ({"a": [{"numeric": ["!=", 5]}]}, "a[0].numeric: is like"),
        ({"a": [{"numeric": [">", 1, ">", 2]}]}, "at most one bound below and one above"),
        ({"a": [{"numeric": [">", 5, "<", 5]}]}, "a[0].numeric: no number is in"),
        ({"a": [{"numeric": ["=", 5, "<", 7]}]}, "at most one bound below"),
        ({"a": [{"cidr": "10.0.0.1"}]}, "a[0].cidr: '10.0.0.1' is no block"),
        ({"a": [{"cidr": "10.0.0.0/33"}]}, "is no block"),
        ({"a": [{"cidr": "10.0.0.0/255.0.0.0"}]}, "is no block"),
        ({"a": [{"wildcard": "a**b"}]}, "a[0].wildcard: two stars side by side"),
        ({"a": [{"wildcard": "a\\b"}]}, "a[0].wildcard: a backslash stands before"),
        ({"a": [{"wildcard": "a\\"}]}, "a[0].wildcard: a backslash stands before"),
        ({"a": [{"anything-but": []}]}, "a[0].anything-but: refuses a text or a number"),
        ({"a": [{"anything-but": ["x", 1]}]}, "a[0].anything-but: refuses a text or a number"),
        ({"a": [{"anything-but": None}]}, "a[0].anything-but: refuses a text or a number"),
        ({"a": [{"anything-but": {"numeric": ["=", 1]}}]}, "refuses values, or one of prefix, suffix, wildcard"),
        ({"a": [{"anything-but": {"prefix": []}}]}, "a[0].anything-but.prefix: an empty list refuses nothing"),
        ({"$or": [{"a": [1]}]}, "$or: is a list of two objects or more"),
        ({"b": {"$or": [{"a": [1]}, {"a": 1}]}}, "b.$or[1].a: is a list of values"),
        ({5: [1]}, "'5': a field's name is a text"),
    ],
)
def test_what_is_refused_is_named_by_its_path(document: Any, said: str) -> None:
    with pytest.raises(PatternError) as caught:
        compile_pattern(document)
    assert said in str(caught.value)
    assert caught.value.code == "pattern_invalid"


def test_it_has_a_size_a_depth_and_a_number_of_values() -> None:
    small = dataclasses.replace(LIMITS, pattern_bytes=40, pattern_depth=3, pattern_values=8)
    with pytest.raises(PatternError, match=r"has 61 bytes as JSON; at most 40 \(pattern_bytes\)"):
        compile_pattern({"a": ["x" * 50]}, limits=small)
    with pytest.raises(PatternError, match=r"a\.b\.c: is deeper than 3 objects \(pattern_depth\)"):
        compile_pattern({"a": {"b": {"c": {"d": [1]}}}}, limits=small)
    with pytest.raises(PatternError, match=r"a\[0\]\.anything-but: more than 8 fields and values \(pattern_values\)"):
        compile_pattern({"a": [{"anything-but": list(range(9))}]}, limits=small)
    deep: Document = {"x": [1]}
    for _ in range(5000):
        deep = {"a": deep}
    with pytest.raises(PatternError, match="pattern_depth"):
        compile_pattern(deep)


def test_many_stars_and_a_long_text_take_no_long_time() -> None:
    stars = compile_pattern({"a": [{"wildcard": "*".join("aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaab")}]})
    assert not stars.matches({"a": "a" * 1_000_000})


def test_an_event_may_be_deep() -> None:
    value: Any = "x"
    for _ in range(50_000):
        value = [value]
    assert compile_pattern({"a": ["x"]}).matches({"a": value})


def test_it_keeps_what_it_was_read_from() -> None:
    document = {"source": ["metaros"], "detail": {"level": [{"numeric": ["<", 20]}]}}
    assert json.dumps(compile_pattern(document).document) == json.dumps(document)
