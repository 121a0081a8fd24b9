"""The canonical bytes, and what is refused while reading."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import pytest
from hypothesis import given

from metaros.fleet.twin import MAX_BYTES, MAX_DEPTH, TwinError, canonical, digest, read, same
from tests.metaros.fleet.twin.documents import DOCUMENTS, FEW, VALUES
from tests.support.tables import cases


@FEW
@given(DOCUMENTS)
def test_reading_the_bytes_gives_the_document(document: Any) -> None:
    data = canonical(document)
    assert same(read(data), document)
    assert canonical(read(data)) == data


@FEW
@given(VALUES, VALUES)
def test_two_values_are_the_same_exactly_when_their_bytes_are(one: Any, other: Any) -> None:
    assert same(one, other) == (canonical(one) == canonical(other))


def test_keys_are_sorted_and_there_are_no_spaces() -> None:
    assert canonical({"b": [1, 2.5], "a": "é\n"}) == '{"a":"é\\n","b":[1,2.5]}'.encode()
    assert digest({"a": 1}) == hashlib.sha256(b'{"a":1}').digest() == digest(b'{"a":1}')


@cases(
    ("text", "said"),
    [
        ('{"a": 1, "a": 1}', "a: this key is there twice"),
        ('{"x": {"b": 1, "b": 2}}', "b: this key is there twice"),
        ('{"a": NaN}', "NaN is no JSON value"),
        ('{"a": -Infinity}', "-Infinity is no JSON value"),
        ('{"a": 1e999}', "a: a finite number"),
        ('{"a": 9223372036854775808}', "a: an integer from"),
        ('{"a": ' + "1" * 5000 + "}", "an integer is outside"),
        ('{"a": "\\ud800"}', "half of a surrogate pair"),
        ('{"\\udfff": 1}', "half of a surrogate pair"),
        ("[1]", "the document is a JSON object, not a list"),
        ("{", "no JSON at line 1, column 2"),
        ('{"a":' * 100 + "1" + "}" * 100, f"more than {MAX_DEPTH} levels deep"),
        ('{"a":' * 40_000 + "1" + "}" * 40_000, f"more than {MAX_DEPTH} levels deep"),
        ('{"a": "' + "x" * MAX_BYTES + '"}', f"at most {MAX_BYTES} are taken"),
        ('{"a": [' + "1," * 70_000 + "1]}", "more than 65536 values"),
        (b'{"a": "\xff"}', "not UTF-8 at byte 7"),
        ("\ud800", "not UTF-8"),
    ],
)
def test_what_others_might_read_differently_is_refused(text: Any, said: str) -> None:
    with pytest.raises(TwinError) as caught:
        read(text)
    assert said in str(caught.value)


def test_what_is_no_json_has_no_bytes() -> None:
    deep: Any = {}
    for _ in range(100_000):
        deep = {"a": deep}
    for value in ({"a": float("nan")}, {"a": b"x"}, {1: 2}, {"a": (1,)}, deep, {"a": "x" * MAX_BYTES}):
        with pytest.raises(TwinError):
            canonical(value)
    flat = json.loads("[" * (MAX_DEPTH - 1) + "]" * (MAX_DEPTH - 1))
    assert canonical({"a": flat})
