"""Any text is a definition or a `DefinitionError`; a definition survives its own text."""

from __future__ import annotations

import contextlib

from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.errors import DefinitionError, MetarosError
from metaros.idl import Catalogue, add_schema_text, definition_text, parse_definition, parse_msg, schema_text

WORDS = [
    "int32",
    "string<=4",
    "uint8[]",
    "a/B",
    "B[<=3]",
    "x",
    "yy",
    "X_Y",
    "=",
    "[1,2]",
    '"a"',
    "#",
    "---",
    "'",
    "time",
]
LINES = st.lists(st.sampled_from(WORDS), max_size=5).map(" ".join)
TEXTS = st.one_of(st.text(max_size=80), st.lists(LINES, max_size=6).map("\n".join))


@settings(max_examples=40)
@given(TEXTS, st.sampled_from(["p/msg/N", "p/srv/N", "p/action/N"]))
def test_any_text(text: str, name: str) -> None:
    try:
        definition = parse_definition(text, name)
    except DefinitionError:
        return
    assert parse_definition(definition_text(definition), name) == definition


@settings(max_examples=40)
@given(TEXTS)
def test_any_schema_text(text: str) -> None:
    catalogue = Catalogue()
    try:
        add_schema_text("p/msg/N", text, catalogue)
    except MetarosError:
        assert catalogue.names() == []
        return
    again = Catalogue()
    add_schema_text("p/msg/N", schema_text("p/msg/N", catalogue), again)
    assert again.get("p/msg/N") == catalogue.get("p/msg/N")


@settings(max_examples=40)
@given(st.text(max_size=40))
def test_any_name(name: str) -> None:
    with contextlib.suppress(DefinitionError):
        parse_msg("int32 a", name)
