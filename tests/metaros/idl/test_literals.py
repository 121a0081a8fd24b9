"""Literals of interface definitions."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.errors import DefinitionError
from metaros.idl.literals import format_literal, parse_list, parse_scalar, unquoted_comment_start
from tests.support.tables import cases, refusal


@cases(
    ("line", "rest"),
    [
        ("int32 a # b", "int32 a "),
        ("string a 'x # y' # z", "string a 'x # y' "),
        ('string A="#" # z', 'string A="#" '),
        ("int32 a # it's # b", "int32 a "),
        ("int32 it's # b", "int32 it's "),
        (r'string a "\"#" # z', r'string a "\"#" '),
        ("plain", "plain"),
    ],
)
def test_where_the_comment_begins(line: str, rest: str) -> None:
    assert line[: unquoted_comment_start(line)] == rest


def test_an_escaped_quote_closes_no_text() -> None:
    assert parse_scalar("string", r'"a\\"') == "a\\"
    for text in (r'"a\"', r"'a\'", r'"\\\"', '"a', '"'):
        assert "no closing quote" in refusal(DefinitionError, parse_scalar, "string", text), text


@settings(max_examples=40)
@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_text_survives(text: str) -> None:
    assert parse_scalar("string", format_literal("string", text)) == text


@settings(max_examples=40)
@given(st.lists(st.text("ab, '\"\\[]#\n")))
def test_lists_of_text_survive(texts: list[str]) -> None:
    assert parse_list("string", format_literal("string", texts)) == texts


@settings(max_examples=40)
@given(st.floats(allow_nan=False), st.integers(-(2**63), 2**64 - 1), st.booleans())
def test_numbers_survive(number: float, whole: int, flag: bool) -> None:
    assert parse_scalar("float64", format_literal("float64", number)) == number
    assert parse_scalar("int64", format_literal("int64", whole)) == whole
    assert parse_scalar("bool", format_literal("bool", flag)) is flag
