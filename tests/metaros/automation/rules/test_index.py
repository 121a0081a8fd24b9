"""The index finds what each pattern alone would say."""

from __future__ import annotations

import random  # noqa: TID251 - of hypothesis
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from load_tests.benchmarks.gateway import rules
from metaros.automation.rules.errors import PatternError
from metaros.automation.rules.index import PatternIndex
from metaros.automation.rules.pattern import compile_pattern
from tests.metaros.automation.rules.cases import event, pattern
from tests.support.tables import cases

SEEDS = st.integers(min_value=0, max_value=2**32)


@settings(max_examples=40, deadline=None)
@given(SEEDS, st.integers(1, 40))
def test_it_finds_what_each_pattern_says(seed: int, count: int) -> None:
    rng = random.Random(seed)
    events = [event(rng) for _ in range(6)]
    patterns = {str(number): compile_pattern(pattern(rng, rng.choice(events))) for number in range(count)}
    index = PatternIndex()
    for key, made in patterns.items():
        index.put(key, made)
    for about in events:
        found = index.match(about)
        assert sorted(found) == sorted(key for key, made in patterns.items() if made.matches(about))


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.lists(st.tuples(st.integers(0, 12), st.booleans()), max_size=60))
def test_patterns_come_and_go(seed: int, changes: list[tuple[int, bool]]) -> None:
    rng = random.Random(seed)
    about = event(rng)
    index, kept = PatternIndex(), {}
    for number, put in changes:
        if put:
            kept[str(number)] = compile_pattern(pattern(rng, about))
            index.put(str(number), kept[str(number)])
        else:
            kept.pop(str(number), None)
            index.remove(str(number))
        assert set(index.match(about)) == {key for key, made in kept.items() if made.matches(about)}
    assert len(index) == len(kept)
    for key in kept:
        assert key in index
        index.remove(key)
    assert index.match(about) == []
    assert len(index) == 0


def test_a_set_of_rules_as_fleets_have_it() -> None:
    figures = rules.measure(count=300, event_count=100)
    assert figures.matches > 0.5


@cases(
    "entries",
    [
        [{"numeric": ["<", 3]}, {"numeric": [">", 5]}],
        [{"anything-but": [3]}, {"anything-but": [4]}],
        [{"anything-but": ["x"]}, {"anything-but": {"prefix": "a"}}],
        [{"wildcard": "*b*"}, {"cidr": "10.0.0.0/8"}, 4, None],
        [{"exists": False}, {"suffix": "b"}, True],
        [{"prefix": {"equals-ignore-case": "A"}}, {"suffix": {"equals-ignore-case": "B"}}, {"equals-ignore-case": "X"}],
    ],
)
@cases("value", [3, 4, 4.5, 6, "x", "X", "ab", "AB", "10.2.3.4", None, True, False, [], [3, "ab"], {}])
def test_lists_of_several_entries(entries: list[Any], value: Any) -> None:
    made, index = compile_pattern({"a": entries}), PatternIndex()
    index.put("it", made)
    assert index.match({"a": value}) == (["it"] if made.matches({"a": value}) else [])


def test_many_bounds_of_one_field() -> None:
    index = PatternIndex()
    for low in range(200):
        index.put(f"{low}", {"a": [{"numeric": [">=", low, "<", low + 3]}]})
    assert sorted(index.match({"a": 100})) == ["100", "98", "99"]
    assert sorted(index.match({"a": 100.5})) == ["100", "98", "99"]
    assert index.match({"a": 300}) == []
    index.remove("99")
    assert sorted(index.match({"a": 100})) == ["100", "98"]
    assert index.match({"a": float("nan")}) == []


def test_a_product_of_choices_too_large_for_clauses_is_found_all_the_same() -> None:
    choices = [{"$or": [{f"f{number}": [digit]} for digit in range(4)]} for number in range(4)]
    document: dict[str, Any] = {"kind": ["x"], **{f"part{number}": each for number, each in enumerate(choices)}}
    index = PatternIndex()
    index.put("it", document)
    about: dict[str, Any] = {"kind": "x", **{f"part{number}": {f"f{number}": number} for number in range(4)}}
    assert index.match(about) == ["it"]
    for number in range(4):
        assert index.match(about | {f"part{number}": {f"f{number}": 9}}) == []
    assert index.match(about | {"kind": "y"}) == []


@cases(
    ("joints", "found"),
    [
        ([{"name": "hip", "torque": 9}], ["both", "name", "quiet"]),
        ([{"name": "hip"}, {"torque": 9}], ["name", "quiet"]),
        ([{"name": "hip"}, {"name": "knee", "hot": 1}], ["name", "quiet"]),
        ([{"name": "hip", "hot": 1}, {"torque": 9}], ["name"]),
        ([{"name": "knee"}], []),
        ([], []),
    ],
)
def test_fields_of_a_list_of_objects(joints: list[Any], found: list[str]) -> None:
    index = PatternIndex()
    index.put("name", {"joints": {"name": ["hip"]}})
    index.put("both", {"joints": {"name": ["hip"], "torque": [9]}})
    index.put("quiet", {"joints": {"name": ["hip"], "hot": [{"exists": False}]}})
    assert sorted(index.match({"joints": joints})) == found


def test_a_pattern_that_is_wrong_leaves_what_was_there() -> None:
    index = PatternIndex()
    index.put("it", {"a": [1]})
    with pytest.raises(PatternError):
        index.put("it", {"a": 1})
    assert index.match({"a": 1}) == ["it"]


def test_only_absence_is_found_in_every_event() -> None:
    index = PatternIndex()
    index.put("none", {"a": [{"exists": False}]})
    index.put("either", {"a": [{"exists": False}, "x"]})
    assert sorted(index.match({})) == ["either", "none"]
    assert index.match({"a": "x"}) == ["either"]
    assert index.match({"a": "y"}) == []
