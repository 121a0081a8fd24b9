"""Commands and answers of the board."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.diff_drive.protocol import MAX_TICKS, is_ok, parse_encoders, speeds


def test_speeds_are_a_line() -> None:
    assert speeds(12, -34) == b"m 12 -34\r"
    assert speeds(MAX_TICKS, -MAX_TICKS) == b"m 32767 -32767\r"


def test_speeds_beyond_16_bits_are_limited_together() -> None:
    assert speeds(65534, 32767) == b"m 32767 16383\r"


@pytest.mark.parametrize(
    ("line", "counts"),
    [
        ("12 -34", (12, -34)),
        (" 2147483647 -2147483648 ", (2147483647, -2147483648)),
        ("2147483648 0", None),
        ("1 2 3", None),
        ("12", None),
        ("OK", None),
        ("1.5 2", None),
        ("--1 2", None),
        ("9" * 60 + " 1", None),
    ],
)
def test_encoders_are_two_numbers_of_32_bits(line: str, counts: tuple[int, int] | None) -> None:
    assert parse_encoders(line) == counts


@settings(deadline=None)
@given(st.text(max_size=64))
def test_any_line_is_counts_within_32_bits_or_none(line: str) -> None:
    counts = parse_encoders(line)
    assert counts is None or all(-(2**31) <= count < 2**31 for count in counts)
    assert not (counts and is_ok(line))
