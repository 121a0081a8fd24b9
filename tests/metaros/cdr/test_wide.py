"""Wide strings."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.cdr.wide import decode_wide, encode_wide


@settings(max_examples=40)
@given(st.text(st.characters(exclude_categories=["Cs"])), st.sampled_from(["<", ">"]))
def test_round_trip(text: str, order: str) -> None:
    data = encode_wide(text, order)
    assert decode_wide(data, 0, len(data) // 4, order) == text


def test_units_that_are_none() -> None:
    with pytest.raises(ValueError, match="16 bits"):
        decode_wide(b"\0\0\1\0", 0, 1)
    with pytest.raises(ValueError):
        decode_wide(b"\0\0", 0, 1)
    with pytest.raises(UnicodeDecodeError):
        decode_wide(b"\0\xd8\0\0", 0, 1)
    assert decode_wide(b"\0\xd8\0\0", 0, 1, errors="replace") == "\ufffd"
