"""Parameters from texts and typed values."""

from __future__ import annotations

from typing import Any

import pytest

from metaros.drivers.manifest import Manifest, Parameter
from metaros.drivers.values import read_values
from metaros.errors import ConfigError

MANIFEST = Manifest(
    kind="toy",
    name="Toy",
    summary="Toys.",
    quality="bronze",
    parameters=(
        Parameter(name="word", type="text", default="", summary="A word."),
        Parameter(name="mode", type="text", default="a", choices=("a", "b"), summary="One of two."),
        Parameter(name="count", type="integer", default=1, minimum=0, maximum=9, summary="How many."),
        Parameter(name="rate", type="number", default=1.0, minimum=0.5, summary="How often."),
        Parameter(name="loud", type="flag", default=False, summary="Whether."),
    ),
)


@pytest.mark.parametrize(
    ("name", "given", "value"),
    [
        ("word", "x", "x"),
        ("count", "9", 9),
        ("count", 0, 0),
        ("rate", "2.5", 2.5),
        ("rate", 3, 3.0),
        ("loud", "Yes", True),
        ("loud", "off", False),
        ("loud", True, True),
        ("mode", "b", "b"),
    ],
)
def test_what_fits_is_converted(name: str, given: Any, value: Any) -> None:
    found = read_values(MANIFEST, {name: given})[name]
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("name", "given", "said"),
    [
        ("count", "10", "must be 0 to 9"),
        ("count", "1.5", "whole number"),
        ("count", True, "must be a integer"),
        ("count", 1.0, "must be a integer"),
        ("rate", "nan", "must be 0.5 to inf"),
        ("rate", "inf", "must be 0.5 to inf"),
        ("rate", "0.1", "must be 0.5"),
        ("rate", [1], "must be a number"),
        ("loud", "maybe", "true or false"),
        ("loud", 1, "must be a flag"),
        ("mode", "c", "one of a, b"),
        ("word", "a\0b", "NUL"),
        ("word", "x" * 5000, "4096"),
        ("words", "x", "did you mean 'word'"),
    ],
)
def test_what_does_not_fit_is_named(name: str, given: Any, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        read_values(MANIFEST, {name: given})
