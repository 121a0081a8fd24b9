"""Lines to numbers."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from metaros.drivers.serial_sensor.fields import field_names, line_reader
from metaros.errors import ConfigError

PATTERN = r"T=(?P<t>[-0-9.]+)(?: H=(?P<h>\S+))?"


@pytest.mark.parametrize(
    ("form", "names", "line", "numbers"),
    [
        ("csv", "a,b", "1.5,2", {"a": 1.5, "b": 2.0}),
        ("csv", "a,-,b", "1; 7 ;\t3", {"a": 1.0, "b": 3.0}),
        ("csv", "a,b", "  1   2  9", {"a": 1.0, "b": 2.0}),
        ("csv", "a,b", "x,2", {"b": 2.0}),
        ("csv", "a", "nan", {}),
        ("json", "a,b.c", '{"a": 1, "b": {"c": -2.5}}', {"a": 1.0, "b.c": -2.5}),
        ("json", "a,b.c", '{"a": true, "b": 3}', {"a": 1.0}),
        ("json", "a", '{"a": 1e999}', {}),
        ("pattern", "t,h", "T=21.5 H=40", {"t": 21.5, "h": 40.0}),
        ("pattern", "t,h", "T=21.5", {"t": 21.5}),
    ],
)
def test_numbers_of_a_line(form: str, names: str, line: str, numbers: dict[str, float]) -> None:
    read = line_reader(form, field_names(names, columns=form == "csv"), PATTERN)
    assert read(line) == numbers


@pytest.mark.parametrize(("form", "line"), [("csv", "1"), ("json", "[1]"), ("json", "{"), ("pattern", "H=3")])
def test_what_is_no_line_of_that_form(form: str, line: str) -> None:
    read = line_reader(form, ("t", "h"), PATTERN)
    with pytest.raises(ValueError, match=r".+"):
        read(line)


def test_json_nested_without_end_is_no_line() -> None:
    with pytest.raises(ValueError, match="nested too deep"):
        line_reader("json", ("t",), "")('{"t":' + "[" * 100_000)


@given(st.sampled_from(["csv", "json", "pattern"]), st.text(max_size=200))
def test_any_text_is_numbers_or_no_line(form: str, line: str) -> None:
    read = line_reader(form, ("t", "h"), PATTERN)
    try:
        numbers = read(line)
    except ValueError:
        return
    assert set(numbers) <= {"t", "h"}


@pytest.mark.parametrize("text", ["", "a,a", "1a", "a b", "-", "a/b", "../x", ",".join(f"f{n}" for n in range(65))])
def test_names_that_cannot_be(text: str) -> None:
    with pytest.raises(ConfigError, match="fields"):
        field_names(text, columns=True)


@pytest.mark.parametrize("pattern", ["(", "(?P<x>.)"])
def test_patterns_that_cannot_be(pattern: str) -> None:
    with pytest.raises(ConfigError, match="pattern"):
        line_reader("pattern", ("t",), pattern)
