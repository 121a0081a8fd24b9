"""The same patterns, the same events, the same answers as moto's matcher, but where that is wrong.

moto differs from AWS's documentation in the classes of `WRONG`. A case is left out only if one of its fields is in
such a class; each class has an example below that shows both answers, so that it is dropped once moto is mended.
"""

from __future__ import annotations

import json
import random  # noqa: TID251 - seeded
from collections.abc import Iterator
from typing import Any

from moto.events.models import EventPattern

from metaros.automation.rules.field_matcher import flat
from metaros.automation.rules.pattern import compile_pattern
from tests.metaros.automation.rules.cases import event, pattern
from tests.support.tables import cases

CASES = 2400
AT_LEAST = 1000
Document = dict[str, Any]

WRONG = {
    "boolean": "true and 1, false and 0 are one value to it, and true is a number; to JSON, and AWS, they are not",
    "empty": "an empty list or object is a value to it; AWS knows values of leaves only, so that the field is absent",
    "nested": "it does not look into lists in lists, nor at objects in lists; AWS goes through both",
    "lines": "its star does not stand for the end of a line; AWS's stands for any letters",
    "number_address": "a number is an IP address to it; AWS takes texts",
}


def moto_says(document: Document, about: Document) -> bool:
    """moto's answer."""
    return EventPattern.load(json.dumps(document)).matches_event(about)  # type: ignore[arg-type]


def fields(document: Document, about: Any) -> Iterator[tuple[list[Any], Any]]:
    """The lists of a pattern, each with what an event has there; of a list with objects, that list."""
    for name, part in document.items():
        value = about.get(name) if isinstance(about, dict) else about
        if name == "$or":
            for each in part:
                yield from fields(each, about)
        elif isinstance(part, dict):
            yield from fields(part, value if isinstance(value, dict) else value if is_nested(value) else None)
        else:
            yield part, value


def is_nested(value: Any) -> bool:
    """Whether it is a list with more than scalars in it."""
    return isinstance(value, list) and any(isinstance(item, dict | list) for item in value)


def numbers_in(entries: Any) -> bool:
    """Whether an entry of a pattern names a number."""
    if isinstance(entries, dict):
        return any(numbers_in(item) for item in entries.values() if not isinstance(item, bool))
    if isinstance(entries, list):
        return any(map(numbers_in, entries))
    return isinstance(entries, int | float) and not isinstance(entries, bool)


def wrong(entries: list[Any], value: Any) -> str | None:
    """The class in which moto is wrong about a field, or None."""
    values = list(flat(value)) if isinstance(value, list) else [value]
    operators = {name for entry in entries if isinstance(entry, dict) for name in entry}
    if is_nested(value):
        return "nested"
    if value in ([], {}) and operators & {"exists", "anything-but"}:
        return "empty"
    if any(isinstance(item, bool) for item in values) and numbers_in(entries):
        return "boolean"
    if any(item in (0, 1) for item in values) and any(isinstance(entry, bool) for entry in entries):
        return "boolean"
    if "wildcard" in json.dumps(entries) and any(isinstance(item, str) and "\n" in item for item in values):
        return "lines"
    if "cidr" in operators and any(isinstance(item, int) for item in values):
        return "number_address"
    return None


def test_a_thousand_cases_have_the_answers_of_moto() -> None:
    rng = random.Random(20261122)
    compared = matched = 0
    left_out = dict.fromkeys(WRONG, 0)
    for _ in range(CASES):
        about = event(rng)
        document = pattern(rng, about)
        classes = {found for field in fields(document, about) if (found := wrong(*field))}
        for each in classes:
            left_out[each] += 1
        if not classes:
            ours = compile_pattern(document).matches(about)
            assert ours == moto_says(document, about), json.dumps([document, about])
            compared, matched = compared + 1, matched + ours
    assert compared >= AT_LEAST
    assert 0.3 < matched / compared < 0.7
    assert all(left_out.values())


@cases(
    ("kind", "document", "about", "ours"),
    [
        ("boolean", {"a": [1]}, {"a": True}, False),
        ("boolean", {"a": [{"numeric": [">", 0]}]}, {"a": True}, False),
        ("boolean", {"a": [{"anything-but": 1}]}, {"a": True}, True),
        ("empty", {"a": [{"exists": True}]}, {"a": []}, False),
        ("empty", {"a": [{"exists": False}]}, {"a": {}}, True),
        ("empty", {"a": [{"anything-but": "x"}]}, {"a": {}}, False),
        ("nested", {"a": {"b": [1]}}, {"a": [{"b": 1}]}, True),
        ("nested", {"a": [1]}, {"a": [[1]]}, True),
        ("lines", {"a": [{"wildcard": "x*y"}]}, {"a": "x\ny"}, True),
        ("number_address", {"a": [{"cidr": "0.0.0.0/8"}]}, {"a": 5}, False),
    ],
)
def test_where_moto_is_wrong(kind: str, document: Document, about: Document, ours: bool) -> None:
    assert compile_pattern(document).matches(about) is ours
    assert moto_says(document, about) is not ours
    assert kind in {wrong(*field) for field in fields(document, about)}
